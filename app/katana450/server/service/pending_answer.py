"""Answers that come later: with the outcome of a command, or at the end of its motion."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace

import msgspec

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.messages import ABOUT_NOW, sentence
from katana450.arm.control.state.state import GRIPPER_REASONS, Status
from katana450.errors import KatanaError
from katana450.server.api import answers
from katana450.server.service import serialize
from katana450.server.service.hub import TICK, Hub
from katana450.server.service.participants import Participant

UNKNOWN = "unknown"
"""Outcome of a command that the arm's process does not report in time."""

OUTCOME_SECONDS = 1.0
"""Timeout [s] for the outcome of a command from the arm's process; a tick takes 10 ms."""

REST_SECONDS = 2.0
"""Timeout [s] for the arm to come to rest after a motion that did not reach its end."""

REACHED, LIMITED, CONTACT, PAUSED, STOPPED, FAILED, TIMEOUT = (
    *("reached", "limited", "contact", "paused", "stopped", "failed", "timeout"),
)
SUPERSEDED, LEASE_LOST = "superseded", "lease lost"

ENDS = {
    Status.OK: REACHED,
    Status.LIMITED: LIMITED,
    Status.GAP: LIMITED,
    Status.BLOCKED: CONTACT,
    Status.PAUSED: PAUSED,
    Status.STOPPED: STOPPED,
    Status.FAULT: FAILED,
}
"""The end of a motion by the status of the arm at rest."""

ARRIVED = (REACHED, LIMITED)
"""Ends of a motion that came as near to its target as the arm can."""


class PendingAnswer:
    """The answer to a request that is executed and not answered yet.

    While a request waits for the end of its motion, the open connection of its participant counts
    as heartbeats. At the end nothing moves any more, and a lease that the request has acquired is
    released.

    Attributes:
        done: the answer so far, without the outcome of the command and the end of the motion.
    """

    def __init__(
        self,
        hub: Hub,
        participant: Participant,
        done: answers.Done,
        wait: float | None = None,
        late: Awaitable[answers.Done] | None = None,
        *,
        fingers: bool = False,
    ) -> None:
        """Begin to wait for the parts that ``done`` lacks.

        ``wait``: maximum duration of the motion [s]; None to answer with the outcome. ``late``: an
        answer that takes long, in place of ``done``. ``fingers``: whether the fingers move, and not
        the arm.
        """
        self._late = late
        self._hub, self._participant, self.done, self._wait = hub, participant, done, wait
        self._motions, self._revocations = hub.gate.motions, hub.gate.revocations
        self._began, self._fingers = hub.clock(), fingers
        self._programmed = hub.runner.runs_for(participant)
        participant.heartbeat.open += self.waits

    @property
    def waits(self) -> bool:
        """True if the answer comes at the end of a motion."""
        return self._wait is not None

    async def answer(self) -> answers.Answer:
        """Return the answer once it is complete. Call this once.

        A command that the session refuses is answered by ``answers.Refused``.
        """
        if self._wait is None:
            return await self._concluded()
        try:
            done = await self._concluded()
            if isinstance(done, answers.Done):
                done = msgspec.structs.replace(done, end=await self._ended(self._wait))
        finally:
            self._participant.heartbeat.open -= 1
        # Not after a cancellation: the participant then leaves, which stops a moving arm.
        give_back(self._hub, self._participant)
        # Releasing the lease makes the arm hold; later queries include that.
        await self._until(lambda: self._hub.present().caught_up, OUTCOME_SECONDS)
        return done

    async def _concluded(self) -> answers.Answer:
        """Return the answer with the outcome of the command, as the arm's process reports it."""
        if self._late is not None:
            try:
                self.done = msgspec.structs.replace(await self._late, id=self.done.id)
            except KatanaError as error:
                return answers.Refused(id=self.done.id, why=str(error))
            # Motions and stops from before the command do not end its motion.
            gate = self._hub.gate
            self._motions, self._revocations = gate.motions, gate.revocations
        ticket = self.done.ticket
        if ticket is None or self.done.outcome is not None:
            return self.done
        try:
            async with asyncio.timeout(OUTCOME_SECONDS):
                outcome = await asyncio.wrap_future(self._hub.present().outcome(ticket))
        except TimeoutError:
            return msgspec.structs.replace(self.done, outcome=UNKNOWN)
        return serialize.concluded(self.done, outcome)

    async def _ended(self, wait: float) -> answers.MotionEnd:
        """Return the end of the motion, once the arm is at rest."""
        hub = self._hub
        await self._until(lambda: self._end() is not None, wait)
        how, why = self._end() or (TIMEOUT, f"The motion did not end within {wait:g} s.")
        if how in (TIMEOUT, CONTACT):
            self._drop(f"the motion ended with {how}")
        if how not in (SUPERSEDED, LEASE_LOST):
            await self._until(lambda: not hub.present().state.moving, REST_SECONDS)
        return serialize.motion_end(hub.present(), how, why, hub.clock() - self._began)

    async def _until(self, true: Callable[[], bool], seconds: float) -> None:
        """Wait until ``true`` returns True, at most for ``seconds``."""
        latest = self._hub.clock() + seconds
        while not true() and self._hub.clock() < latest:
            await asyncio.sleep(TICK)

    def _end(self) -> tuple[str, str] | None:
        """Return how the motion has ended, and why in words; None before its end."""
        hub, arm = self._hub, self._hub.present()
        state = arm.state
        if (stopped := hub.stopped) is not None:
            return STOPPED, stopped.why
        rests = arm.caught_up and not state.moving and not arm.busy
        if hub.runner.runs_for(self._participant):
            halted = rests and (state.paused or state.blocked)
            return (ENDS[state.status], sentence(state)) if halted and hub.runner.running else None
        if self._programmed:
            return self._program_end()
        if arm.caught_up and state.waits:
            return PAUSED, sentence(state)
        if hub.gate.revocations != self._revocations:
            return LEASE_LOST, "The arm was stopped, or another client drives it."
        if hub.gate.motions != self._motions:
            return SUPERSEDED, "Another command of this client has superseded the motion."
        if not rests:
            return None
        if arm.planning_failure:
            return FAILED, arm.planning_failure
        own = tuple(
            finding
            for finding in state.findings
            if finding.reason in ABOUT_NOW or (finding.reason in GRIPPER_REASONS) == self._fingers
        )
        state = replace(state, findings=own)
        return ENDS[state.status], sentence(state)

    def _program_end(self) -> tuple[str, str]:
        """Return how the run of a program has ended, and why in words."""
        progress = self._hub.runner.progress()
        if progress is not None and progress.status == "done":
            return REACHED, ""
        return FAILED, (progress.why if progress else "") or "The program did not run."

    def _drop(self, why: str) -> None:
        """Drop the target of the motion, or end the run of the program, because of ``why``."""
        self._hub.runner.end(self._participant, why)
        if self._hub.lease.holder == self._participant.person:
            with suppress(KatanaError):
                self._hub.move(self._participant, cmd.Hold())


def give_back(hub: Hub, participant: Participant) -> None:
    """Release the lease of ``participant`` if its last open request has acquired it."""
    if participant.gives_back and not participant.heartbeat.open:
        participant.gives_back = False
        if hub.lease.holder == participant.person:
            hub.release_lease(participant)
