"""Notes of events for an event log: who did what, as the thread in which it happens notes it.

Taking a note costs about a microsecond and never waits. ``assembly.event_log`` makes records of the
notes, in a thread of its own, and writes them.
"""

from __future__ import annotations

from queue import SimpleQueue
from typing import Any, NamedTuple

from katana450.arm.control.commands.act import Command
from katana450.arm.control.lease import Actor, CommandChannel, Lease, Person, Role
from katana450.arm.runtime.clock import MonotonicClock
from katana450.errors import KatanaError

MAX_WAITING = 4096
"""Maximum number of notes that wait for their reader; more are counted and dropped, except those
that are always kept."""

LEASE_GROUNDS = {
    "acquired": "the lease was free",
    "taken": "an admin may take the lease",
    "expired": "the holder was silent",
}
"""Grounds of a change of the holder of the lease, where that one does not do it."""

REFUSED, ACCEPTED = "refused", "accepted"
"""Values of ``Verdict``."""


class Note(NamedTuple):
    """An event.

    Attributes:
        t: time [s] on the clock of the states.
        kind: kind of the record.
        actor: the participant; None for the arm's own process.
        what: a command, request or log entry, or a JSON value.
        outcome: ``accepted`` or ``refused``, if known.
        why: reason in words.
        grounds: right to do this, in words, where that of the actor does not say it.
        always: whether the note is kept and its record written, whatever the limits.
    """

    t: float
    kind: str
    actor: Actor | None = None
    what: Any = None
    outcome: str = ""
    why: str = ""
    grounds: str = ""
    always: bool = False


class Recorder:
    """Takes notes once it is ``enabled``. Every method may be called in any thread.

    Attributes:
        enabled: whether somebody reads the notes.
        notes: the notes; None asks their reader to end.
        lost: number of notes that were dropped, because too many waited.
        problem: why records are not written, as a sentence; empty while they are.
    """

    def __init__(self) -> None:
        self.enabled = False
        self.notes: SimpleQueue[Note | None] = SimpleQueue()
        self.lost = 0
        self.problem = ""
        self._now = MonotonicClock().now

    def note(self, kind: str, actor: Actor | None, what: Any = None, **more: Any) -> None:
        """Note an event of ``kind``, or count it as lost. ``more``: further fields of ``Note``."""
        if not self.enabled:
            return
        if more.get("always") or self.notes.qsize() < MAX_WAITING:
            self.notes.put(Note(self._now(), kind, actor, what, **more))
        else:
            self.lost += 1

    def command(self, command: Command, actor: Actor) -> None:
        """Note an accepted command."""
        self.note("command", actor, command, outcome=ACCEPTED)

    def refuse(self, what: Any, actor: Actor, error: KatanaError) -> None:
        """Note that ``what``, a command or request or its name, was refused with ``error``.

        An error that passes several callers is noted once.
        """
        if not error.noted:
            error.noted = True
            named = {"request": what} if isinstance(what, str) else what
            self.note("refusal", actor, named, outcome=REFUSED, why=str(error))

    def stop(self, why: str, actor: Actor, *, first: bool) -> None:
        """Note a stop. ``first``: the arm was not stopped before."""
        cause = "protection" if actor.channel is CommandChannel.SERVER else "pressed"
        what = {"stop": cause} if first else {"stop": cause, "repeated": True}
        self.note("stop", actor, what, why=why, outcome=ACCEPTED, always=first)

    def lease(self, act: str, before: Lease, after: Lease, by: Actor) -> None:
        """Note that ``act`` changed the holder of the lease."""
        names = {
            "from": before.holder and before.holder.name,
            "to": after.holder and after.holder.name,
        }
        what = {"lease": act, **{word: name for word, name in names.items() if name}}
        self.note("lease", by, what, grounds=LEASE_GROUNDS.get(act, "holds the lease"))


def stranger(address: str) -> Actor:
    """Return an unknown client at ``address`` as the actor of a note."""
    return Actor(Person("", "Somebody", Role.VIEWER, address=address), CommandChannel.HTTP)
