"""Why the arm does not do what was wished: an entry for every change, to be read afterwards."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.actor import Actor
from katana450.arm.control.state import Finding, Reason, State


@dataclass(frozen=True)
class LogEntry:
    """One reason, when it began to hold the arm back or slow it, and what the numbers were.

    t: [s] on the clock of the states. began: whether it came; otherwise it is over. actor: the
    giver of the newest command then; None before the first one, and where the control loop acted
    by itself. command: the class of that command.
    """

    t: float
    finding: Finding
    began: bool
    actor: Actor | None = None
    command: str = ""


def entries_between(
    before: State, after: State, actor: Actor | None = None, command: str = ""
) -> tuple[LogEntry, ...]:
    """What ``after`` is held back by that ``before`` was not, and what of that is over.

    A reason that stays is no news, whatever its number does meanwhile. ``actor``, ``command``:
    see ``LogEntry``.
    """
    old, new = ({_key(finding) for finding in state.findings} for state in (before, after))
    came = tuple(
        LogEntry(after.t, f, True, actor, command) for f in after.findings if _key(f) not in old
    )
    went = tuple(
        LogEntry(after.t, f, False, actor, command) for f in before.findings if _key(f) not in new
    )
    return (*went, *came)


def _key(finding: Finding) -> tuple[Reason, int | None, tuple[str, str] | None]:
    return finding.reason, finding.axis, finding.parts
