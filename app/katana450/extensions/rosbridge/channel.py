"""The channel of one client of rosbridge: its operations, subscriptions, commands and goals."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Coroutine
from contextlib import nullcontext, suppress
from typing import Any

import msgspec

from katana450.arm.control.lease import HEARTBEAT_INTERVAL
from katana450.errors import InputError, KatanaError, LeaseError
from katana450.extensions.rosbridge import protocol
from katana450.extensions.rosbridge.goals import (
    ERROR_TEXT,
    FollowGoal,
    Goal,
    GoalHost,
    GripperGoal,
)
from katana450.extensions.rosbridge.protocol import Fields, JointJog, NoArguments, TwistStamped
from katana450.extensions.rosbridge.publications import Publications, Subscriptions
from katana450.extensions.rosbridge.servoing import ServoStream
from katana450.server.api import answers, requests
from katana450.server.service.budget import Budget, BusyError
from katana450.server.service.dispatcher import driver_key
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.pending_answer import PendingAnswer
from katana450.server.web.channel import Channel, GoneError, JsonChannel, WebSocketJsonChannel
from katana450.server.web.program_socket import BAD_REQUESTS, REQUESTS

log = logging.getLogger(__name__)
TICK = 0.02
"""[s] Interval at which goals and streams are advanced."""

MAX_GOALS = 4
"""Maximum number of goals of one client at a time."""

REPEAT_SECONDS = 1.0
"""[s] Time during which an equal refusal of messages of a topic is not repeated."""


def status(why: str, op_id: protocol.OpId = None, level: str = "error") -> dict[str, Any]:
    """Return the status operation that gives a client the reason ``why``."""
    named = {} if op_id is None else {"id": op_id}
    return {"op": "status", **named, "level": level, "msg": why}


class RosLine(WebSocketJsonChannel):
    """Operations on an accepted websocket. A status with the reason is sent before it is closed."""

    async def close(self, code: int, why: str) -> None:
        """Send the reason ``why``, and close the websocket."""
        with suppress(GoneError):
            await self.send(msgspec.json.encode(status(why)).decode())
        await super().close(code, why)


class RosChannel(Channel):
    """Channel of one client. Messages of topics that a slow client cannot take are dropped."""

    often, bad = REQUESTS, BAD_REQUESTS

    def __init__(
        self, hub: Hub, line: JsonChannel, budget: Budget, publications: Publications
    ) -> None:
        super().__init__(hub, line, budget)
        self._publications = publications
        self._subscriptions = Subscriptions(hub.clock)
        self._stream = ServoStream(hub, self._ask)
        self._goals: list[Goal] = []
        self._newest: dict[str, dict[str, Any]] = {}
        self._acting = asyncio.Event()
        self._refused: dict[str, tuple[str, float]] = {}
        self._pinged = -math.inf
        self._ping: Callable[[], None] = getattr(line, "ping", lambda: None)

    # Channel

    def decoded(self, text: str | bytes) -> protocol.AnyOp:
        """Return the operation in ``text``. Raises InputError with the reason if it is invalid."""
        return protocol.decoded(text)

    def id_of(self, text: str | bytes) -> protocol.OpId:
        """Return the id in ``text``, which need not be a valid operation; None without one."""
        return protocol.id_of(text)

    def greet(self, participant: Participant) -> None:
        """Take ``participant``, which is the client. The protocol has no greeting."""
        self.participant = participant
        # Clients of rosbridge send no heartbeats; their websockets answer pings.
        participant.heartbeat.pinged = True

    def notify(self, notice: Any) -> None:
        """Queue ``notice``: an operation, or a notice of the server, which becomes a status."""
        if "op" not in notice:
            notice = status(notice.get("why", ""), level="warning")
        super().notify(notice)

    def refuse(self, why: str, request_id: Any, **_more: float) -> None:
        """Send a status with the reason ``why``."""
        self.notify(status(why, request_id))

    def unasked(self, *, urgent: bool) -> tuple[Any, float | None]:
        """Return the next message of a topic or goal, and the time until the next call [s]."""
        if self._newest:
            return self._newest.pop(next(iter(self._newest))), 0.0
        if urgent:
            self._subscriptions.hurry()
        topic, pause = self._subscriptions.next_due()
        if topic is None:
            return None, pause
        driver = "" if self.participant is None else driver_key(self.hub, self.participant)
        try:
            with self.budget.charged(driver):
                message = self._publications.message(protocol.resolved(topic))
        except BusyError as error:
            self._subscriptions.delay(error.retry)
            return None, error.retry
        except LeaseError:
            message = None
        if message is None:
            self._subscriptions.missed(topic)
            return None, 0.0
        self._subscriptions.sent(topic)
        return {"op": "publish", "topic": topic, "msg": message}, 0.0

    async def run(self, participant: Participant) -> None:
        """Receive, send, and continue goals until one side closes the connection."""
        acting = asyncio.create_task(self._act())
        try:
            await super().run(participant)
        finally:
            acting.cancel()
            await asyncio.gather(acting, return_exceptions=True)

    def answer(self, participant: Participant, request: Any) -> None:
        """Execute the operation ``request``. Raises KatanaError if it is refused."""
        op: protocol.AnyOp = request
        self.hub.heartbeat(participant)
        if isinstance(op, protocol.CallService) and op.traits.safety:
            self._trigger(op, requests.Stop())
            return
        charged = self.budget.charged(driver_key(self.hub, participant), question=False)
        with nullcontext() if op.traits.free else charged:
            self._execute(participant, op)
        self.wake()

    # Operations

    def _execute(self, participant: Participant, op: protocol.AnyOp) -> None:
        match op:
            case protocol.Subscribe():
                self._subscriptions.add(op)
            case protocol.Unsubscribe():
                self._subscriptions.remove(op.topic, op.id)
            case protocol.Advertise(topic=topic, type=kind):
                self._check_commanded(topic, kind)
            case protocol.Unadvertise(topic=topic):
                self._check_commanded(topic)
            case protocol.Publish():
                self._publish(op)
            case protocol.CallService():
                self._call(op)
            case protocol.SendActionGoal():
                self._send_goal(participant, op)
            case protocol.CancelActionGoal():
                self._cancel_goal(op)

    def _check_commanded(self, topic: str, kind: str = "") -> None:
        """Raise InputError unless clients can publish to ``topic``, with messages of ``kind``."""
        topic = protocol.resolved(topic)
        known = protocol.COMMANDED.get(topic)
        if known is None:
            reason = "published by the server" if topic in protocol.PUBLISHED else "unknown"
            raise InputError(
                f"The topic {topic} is {reason}. Clients can publish to "
                f"{', '.join(protocol.COMMANDED)}."
            )
        if kind and not protocol.is_type(kind, known):
            raise InputError(f"The messages of {topic} are {known}, not {kind}.")

    def _publish(self, op: protocol.Publish) -> None:
        self._check_commanded(op.topic)
        try:
            if protocol.resolved(op.topic) == protocol.TWIST:
                self._stream.twist(
                    protocol.read(op.msg, TwistStamped, protocol.TOPICS[protocol.TWIST])
                )
            else:
                self._stream.jog(
                    protocol.read(op.msg, JointJog, protocol.TOPICS[protocol.JOINT_JOG])
                )
        except BusyError:
            raise
        except KatanaError as error:
            # A stream can be refused a hundred times a second.
            text, since = self._refused.get(op.topic, ("", -math.inf))
            t = self.hub.clock()
            if text != str(error) or t - since >= REPEAT_SECONDS:
                self._refused[op.topic] = str(error), t
                raise
        if self._stream.moves:
            self._acting.set()

    def _call(self, op: protocol.CallService) -> None:
        service = protocol.resolved(op.service)
        if service not in protocol.SERVICES:
            known = ", ".join(name for name in protocol.SERVICES if protocol.CANCEL not in name)
            why = f"There is no service {service}. The services are {known}."
            self._respond(op, why, result=False)
            raise InputError(why)
        if service in protocol.LISTS:
            self._respond(op, protocol.LISTS[service])
        elif service.endswith(protocol.CANCEL):
            for goal in self._goals:
                if protocol.resolved(goal.action) == service.removesuffix(protocol.CANCEL):
                    goal.cancel("The client cancelled it.")
            self._respond(op, {"return_code": 0, "goals_canceling": []})
        elif service == protocol.HOLD_SERVICE:
            self._hold(op)
        else:
            self._trigger(op, requests.ClearStop())

    def _hold(self, op: protocol.CallService) -> None:
        """Bring the arm to rest: end the goals of this client, or give the command `hold`."""
        running = [goal for goal in self._goals if not (goal.ended or goal.cancelled)]
        for goal in running:
            goal.cancel("The client called /hold.")
        if running:
            self._respond(op, {"success": True, "message": "The goal is cancelled."})
        else:
            self._trigger(op, requests.Hold())

    def _trigger(self, op: protocol.CallService, request: requests.Request) -> None:
        """Execute ``request`` and answer a std_srvs/Trigger with its outcome."""
        try:
            protocol.read(op.args, NoArguments, "a call of std_srvs/Trigger")
        except InputError as error:
            # A stop is executed even if its arguments are invalid.
            if not isinstance(request, requests.Stop):
                self._respond(op, str(error), result=False)
                raise
        try:
            answer = self._handle(request)
        except KatanaError as error:
            self._respond(op, {"success": False, "message": str(error)})
            return
        if isinstance(answer, PendingAnswer):
            self._later(self._conclude_trigger(op, answer))
        else:
            self._respond(op, _triggered(answer))

    async def _conclude_trigger(self, op: protocol.CallService, pending: PendingAnswer) -> None:
        self._respond(op, _triggered(await pending.answer()))

    def _later(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.ensure_future(work)
        self._concluding.add(task)
        task.add_done_callback(self._concluding.discard)

    def _respond(self, op: protocol.CallService, values: Any, *, result: bool = True) -> None:
        named = {} if op.id is None else {"id": op.id}
        response = {"op": "service_response", **named, "service": op.service}
        self.notify({**response, "values": values, "result": result})

    # Actions

    def _send_goal(self, participant: Participant, op: protocol.SendActionGoal) -> None:
        action = protocol.resolved(op.action)
        known = protocol.ACTIONS.get(action)
        try:
            if op.id is None:
                raise InputError("A goal needs an `id`, by which it can be cancelled.")
            if known is None:
                actions = ", ".join(protocol.ACTIONS)
                raise InputError(f"There is no action {op.action}. The actions are {actions}.")
            if op.action_type and not protocol.is_type(op.action_type, known):
                raise InputError(f"The action {op.action} is {known}, not {op.action_type}.")
            self._check_goals(op)
            host = GoalHost(self.hub, participant, self._handle, self.notify, self._show_newest)
            follows = action == protocol.FOLLOW
            earlier = [goal for goal in self._goals if isinstance(goal, FollowGoal)]
            goal = FollowGoal(host, op, earlier) if follows else GripperGoal(host, op)
        except InputError as error:
            refused = {"op": "action_result", "action": op.action, "id": op.id, "result": False}
            self.notify({**refused, "values": str(error), "status": 6})
            raise
        self._goals.append(goal)
        self._later(goal.run())
        self._acting.set()

    def _check_goals(self, op: protocol.SendActionGoal) -> None:
        """Raise InputError if the id of ``op`` is taken, or the client has too many goals."""
        self._goals = [goal for goal in self._goals if not goal.ended]
        if any(goal.id == op.id for goal in self._goals):
            raise InputError(f"There is a goal with the id {op.id!r} already.")
        if len(self._goals) >= MAX_GOALS:
            raise InputError(f"A client can have {MAX_GOALS} goals at a time. Wait for a result.")

    def _cancel_goal(self, op: protocol.CancelActionGoal) -> None:
        for goal in self._goals:
            if (goal.id, goal.action) == (op.id, op.action):
                goal.cancel("The client cancelled it.")
                return
        raise InputError(f"There is no goal {op.id!r} of {op.action}. It may have ended.")

    def _show_newest(self, key: str, op: dict[str, Any]) -> None:
        if key not in self._newest and len(self._newest) >= MAX_GOALS:
            # The oldest is of a goal that has ended; the client reads slowly.
            del self._newest[next(iter(self._newest))]
        self._newest[key] = op
        self.wake()

    async def _act(self) -> None:
        """Continue goals and streams while there are any; an error ends the connection."""
        try:
            while await self._acting.wait():
                self._acting.clear()
                while self._goals or self._stream.moves or self._comes_to_rest():
                    self._continue()
                    await asyncio.sleep(TICK)
        except Exception:
            log.exception("Error on a channel.")
            await self._disconnect(1011, ERROR_TEXT)

    def _comes_to_rest(self) -> bool:
        """Return whether the arm still moves and this client drives it."""
        person = None if self.participant is None else self.participant.person
        return self.hub.lease.holder == person and self.hub.gate.moves()

    def _continue(self) -> None:
        t = self.hub.clock()
        if t - self._pinged >= HEARTBEAT_INTERVAL:
            self._pinged = t
            self._ping()
        try:
            self._stream.tick()
        except KatanaError as error:
            self.notify(status(str(error)))
        for goal in self._goals:
            goal.tick()
        self._goals = [goal for goal in self._goals if not goal.ended]

    def _ask(self, request: requests.Request) -> answers.Answer:
        """Execute ``request`` and return its answer so far. Raises KatanaError if it is refused."""
        answer = self._handle(request)
        return answer.done if isinstance(answer, PendingAnswer) else answer

    def _handle(self, request: requests.Request) -> answers.Answer | PendingAnswer:
        assert self.participant is not None
        return self._dispatcher.handle(self.participant, request, self.budget)


def _triggered(done: answers.Answer) -> Fields:
    """Return the answer to a request as the response of a std_srvs/Trigger."""
    if isinstance(done, answers.Refused):
        return {"success": False, "message": done.why}
    outcome = done.outcome if isinstance(done, answers.Done) else None
    return {"success": True, "message": outcome or "accepted"}
