"""Entries of the event log: each finding that begins or ends, as a difference of two states."""

from __future__ import annotations

from typing import NamedTuple

from katana450.arm.control.state.state import Finding, Reason, State


class LogEntry(NamedTuple):
    """The start or the end of one finding, with the numbers it had then.

    Attributes:
        t: time [s] on the clock of the states.
        finding: the finding.
        began: True if the finding began; False if it ended.
    """

    t: float
    finding: Finding
    began: bool


def entries_between(before: State | None, after: State) -> tuple[LogEntry, ...]:
    """Return the entries for findings of ``before`` that ended and of ``after`` that began.

    A finding that stays makes no entry, even if its amount changes. Without ``before`` all begin.
    """
    earlier = () if before is None else before.findings
    old, new = ({_key(finding) for finding in findings} for findings in (earlier, after.findings))
    began = tuple(LogEntry(after.t, f, True) for f in after.findings if _key(f) not in old)
    ended = tuple(LogEntry(after.t, f, False) for f in earlier if _key(f) not in new)
    return (*ended, *began)


def _key(finding: Finding) -> tuple[Reason, int | None, tuple[str, str] | None]:
    return finding.reason, finding.axis, finding.parts
