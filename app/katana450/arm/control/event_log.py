"""Entries of the event log: each finding that begins or ends, as a difference of two states."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.actor import Actor
from katana450.arm.control.state import Finding, Reason, State


@dataclass(frozen=True)
class LogEntry:
    """The start or the end of one finding, with the numbers it had then.

    Attributes:
        t: time [s] on the clock of the states.
        finding: the finding.
        began: True if the finding began; False if it ended.
        actor: the giver of the newest command at that time; None before the first command, and
            where the control loop acted by itself.
        command: name of the class of that command.
    """

    t: float
    finding: Finding
    began: bool
    actor: Actor | None = None
    command: str = ""


def entries_between(
    before: State, after: State, actor: Actor | None = None, command: str = ""
) -> tuple[LogEntry, ...]:
    """Return the entries for findings of ``before`` that ended and of ``after`` that began.

    A finding that stays makes no entry, even if its amount changes. ``actor`` and ``command``
    go into the entries; see ``LogEntry``.
    """
    old, new = ({_key(finding) for finding in state.findings} for state in (before, after))
    began = tuple(
        LogEntry(after.t, f, True, actor, command) for f in after.findings if _key(f) not in old
    )
    ended = tuple(
        LogEntry(after.t, f, False, actor, command) for f in before.findings if _key(f) not in new
    )
    return (*ended, *began)


def _key(finding: Finding) -> tuple[Reason, int | None, tuple[str, str] | None]:
    return finding.reason, finding.axis, finding.parts
