"""Dispatch of API requests from every channel: page, WebSocket, TCP, HTTP."""

from __future__ import annotations

import math
from collections.abc import Awaitable
from contextlib import nullcontext
from dataclasses import replace

import msgspec
import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import Request
from katana450.arm.control.state.state import Verdict
from katana450.errors import InputError, KatanaError
from katana450.maths.geometry import so3
from katana450.server.api import answers, requests
from katana450.server.service import serialize
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.budget import Budget, BusyError
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.pending_answer import PendingAnswer, give_back
from katana450.server.service.serialize import once

ACCEPTED, REQUESTED = Verdict.ACCEPTED.value, "requested"
"""Outcomes in answers that do not come from the arm's process."""

MAX_OPEN = 8
"""Maximum number of requests of one participant that wait for the end of a motion."""


def driver_key(hub: Hub, participant: Participant) -> str:
    """Return the key of ``participant`` if it drives or owns the running program, else ``""``."""
    holder, key = hub.lease.holder, participant.person.key
    return key if holder == participant.person or hub.gate.program == (holder, key) else ""


class Dispatcher:
    """Executes requests on behalf of a participant.

    Raises LeaseError if it may not drive and InputError for an invalid request; neither changes
    any state.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    def handle(
        self, participant: Participant, request: Request, budget: Budget
    ) -> answers.Answer | PendingAnswer:
        """Execute ``request`` and return its answer. Counts as a heartbeat of ``participant``.

        The answer is pending until the arm's process reports the outcome of a command, or until
        the end of the motion if the request waits for it.

        The processor time is charged to ``budget``; raises BusyError when that is used up. A
        ``free`` request and a command of the driver cost nothing.
        """
        question, driver = request.traits.question, driver_key(self._hub, participant)
        free = request.traits.free or (driver and not question)
        wait = request.wait if isinstance(request, requests.MotionRequest) else None
        holds = self._hub.lease.holder == participant.person
        if not (request.traits.free or question):
            # A later request without `wait` keeps the lease.
            participant.gives_back = wait is not None and (participant.gives_back or not holds)
        try:
            with nullcontext() if free else budget.charged(driver, question=question):
                if wait is not None and participant.heartbeat.open >= MAX_OPEN:
                    raise InputError(f"At most {MAX_OPEN} requests can wait at once.")
                answer = self._execute(participant, request)
        except KatanaError as error:
            give_back(self._hub, participant)
            if not question or isinstance(error, BusyError):
                self._hub.recorder.refuse(request, participant.actor, error)
            raise

        if not isinstance(answer, answers.Answer):
            return PendingAnswer(self._hub, participant, answers.Done(id=request.id), wait, answer)
        answer = msgspec.structs.replace(answer, id=request.id)
        if isinstance(answer, answers.Done) and (wait or (answer.ticket and not answer.outcome)):
            fingers = isinstance(request, requests.Gripper)
            return PendingAnswer(self._hub, participant, answer, wait, fingers=fingers)
        return answer

    def _execute(
        self, participant: Participant, request: Request
    ) -> answers.Answer | Awaitable[answers.Done]:
        hub = self._hub
        still = request.traits.free or request.traits.question
        limit = math.inf if still else hub.gate.sample_delay
        delay = hub.heartbeat(participant, request.made, limit)
        match request:
            case requests.Heartbeat(n=n):
                return answers.Echo(n=n)
            case requests.Query(at=subject):
                return self.query(subject)
            case requests.Get(node=node, field=field, more=more):
                arm, first = hub.present(), requests.FieldName(node=node, field=field)
                return answers.Values(values=list(arm.nodes.read(arm.state, (first, *more))))
            case requests.Stop(press=press):
                # Answered at once: later states confirm the stop.
                return _done(hub.stop(participant.actor, press), REQUESTED)
            case requests.Watch():
                # The channel has set the rate of states.
                return answers.Done()
        command = self._handled(participant, request) or self._command(request)
        if isinstance(command, answers.Answer | Awaitable):
            return command
        if command is None:
            self._change_lease(participant, request)
            return answers.Done()
        # Read before the move: a stop in between is newer than the answer.
        revocations = hub.gate.revocations
        ticket = hub.move(participant, command, seen=request.revocations, delay=delay)
        # A stream does not wait for its answers. A command that is planned first has no ticket yet.
        at_once = request.traits.at_once or command.traits.planned or not ticket
        done = _done(ticket, ACCEPTED if at_once else None, _misfit(request))
        return msgspec.structs.replace(done, revocations=revocations)

    def _handled(
        self, participant: Participant, request: Request
    ) -> answers.Answer | cmd.Command | Awaitable[answers.Done] | None:
        """Return what the handler of ``request`` does; None for a request of the core."""
        for handler in self._hub.handlers:
            if isinstance(request, handler.request_types):
                if handler is self._hub.runner:
                    actor = replace(participant.actor, seen=request.revocations)
                    self._hub.gate.check_current(actor)
                return handler.handle(participant, request)
        return None

    def _change_lease(self, participant: Participant, request: Request) -> None:
        """Execute a request about the lease."""
        hub, person, actor = self._hub, participant.person, participant.actor
        match request:
            case requests.Acquire():
                hub.gate.acquire(actor)
            case requests.Take():
                hub.take(participant)
            case requests.Ask():
                hub.gate.change(lambda lease, _: lease.request(person), actor)
            case requests.Withdraw():
                hub.gate.change(lambda lease, _: lease.withdraw(person), actor)
            case requests.ReleaseLease():
                hub.release_lease(participant)
            case requests.Give(to=number):
                hub.hand_over(participant, number)
            case requests.Decline(to=number):
                hub.decline(participant, number)
            case requests.Rename(name=name):
                hub.rename(participant, name)

    def _command(self, request: Request) -> cmd.Command | None:
        """Return the command of ``request``; None for a request about the lease."""
        match request:
            case requests.Position() | requests.Pose() | requests.Orient():
                at_base = request.frame is requests.Frame.BASE
                T = self._hub.present().arm.T_base_shoulder if at_base else np.eye(4)
                return request.in_shoulder(T)
            case requests.Set(node=node, field=field, value=value, more=more):
                arm = self._hub.present()
                first = requests.FieldSetting(node=node, field=field, value=value)
                return arm.nodes.command(arm.state, (first, *more))
            case requests.ClearStop():
                return cmd.ClearStop()
        return request if isinstance(request, cmd.Command) else None

    def query(self, subject: str) -> answers.Answer:
        """Return the answer to a ``query`` of ``subject``. Raises LeaseError without an arm."""
        hub = self._hub
        if subject == "state":
            return serialize.state(hub)
        if subject == "program_plan":
            return hub.runner.plan()
        arm = hub.present()
        if subject == "loop":
            return serialize.loop(arm.loop_timing)
        return once(arm.snapshot, subject, lambda: self._derived(arm, subject))

    def _derived(self, arm: ArmHandle, subject: str) -> answers.Answer:
        """Return the answer to a query that depends on the newest snapshot alone."""
        match subject:
            case "arm":
                return serialize.arm(arm)
            case "branches":
                return answers.Branches(
                    choices=[serialize.branch_option(choice) for choice in arm.choices()]
                )
            case "world":
                return arm.nodes.world(arm.state)
        # Each is measured against the arm: 32 ms for as many as there can be.
        return serialize.once(arm.snapshot, "objects", lambda: serialize.objects(arm))


def _done(ticket: int | None, outcome: str | None, misfit: float | None = None) -> answers.Done:
    """Return the answer to a command; a ``ticket`` of 0 stands for no ticket."""
    return answers.Done(ticket=ticket or None, outcome=outcome, rotation_misfit=misfit)


def _misfit(request: Request) -> float | None:
    """Return ``so3.misfit`` of the pose in ``request``; None without a pose."""
    if isinstance(request, requests.Pose | requests.Place | requests.Attach):
        return None if request.T is None else so3.misfit(request.T[:3, :3])
    return None
