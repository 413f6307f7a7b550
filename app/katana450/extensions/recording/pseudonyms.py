"""Records without the identities of people: a file that is passed on must not tell them.

The key of a person names the session of a browser. It is replaced by a pseudonym, the same within
one file, and the network address is left out. Names and roles stay. Keys do
not influence the motion, so a simulation of these records gives the same motion.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

from katana450.arm.control.actor import Actor
from katana450.arm.control.commands.commands import Batch, Command, Stop
from katana450.arm.control.state.state import State
from katana450.arm.control.state.stop_cause import StopCause
from katana450.arm.runtime.tick import Submission, TickRecord

DIGITS = 12
"""Length of a pseudonym."""


class Pseudonyms:
    """The pseudonyms of one file."""

    def __init__(self, salt: bytes) -> None:
        """Make pseudonyms that differ from those of other files. ``salt``: random bytes."""
        self._salt = salt

    def of(self, key: str) -> str:
        """Return the pseudonym of the person with ``key``; an empty key has none."""
        digest = hashlib.blake2b(key.encode(errors="replace"), key=self._salt)
        return digest.hexdigest()[:DIGITS] if key else ""

    def record(self, record: TickRecord) -> TickRecord:
        """Return ``record`` with pseudonyms."""
        state = self._state(record.state)
        if state is record.state and not record.submissions:
            return record
        submissions = [
            Submission(self._command(submission.command), self._actor(submission.actor))
            for submission in record.submissions
        ]
        return record._replace(submissions=submissions, state=state)

    def _actor(self, actor: Actor | None) -> Actor | None:
        if actor is None:
            return None
        person = replace(actor.person, key=self.of(actor.person.key), address="")
        return replace(actor, person=person)

    def _command(self, command: Command) -> Command:
        match command:
            case Stop(cause=cause) if cause.key:
                return Stop(self._cause(cause), command.finding, command.others)
            case Batch(commands=commands):
                return Batch(tuple(map(self._command, commands)))
        return command

    def _state(self, state: State) -> State:
        if state.stopped is None or not state.stopped.cause.key:
            return state
        stopped = replace(state.stopped, cause=self._cause(state.stopped.cause))
        return replace(state, stopped=stopped)

    def _cause(self, cause: StopCause) -> StopCause:
        return replace(cause, key=self.of(cause.key))
