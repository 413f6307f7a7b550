"""Why the arm does not do what was wished: an entry for every change, to be read afterwards."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.state import Finding, Reason, State


@dataclass(frozen=True)
class Entry:
    """One reason, when it began to hold the arm back or slow it, and what the numbers were.

    t: [s] on the clock of the states. began: whether it came; otherwise it is over.
    """

    t: float
    finding: Finding
    began: bool


def news(before: State, after: State) -> tuple[Entry, ...]:
    """What ``after`` is held back by that ``before`` was not, and what of that is over.

    A reason that stays is no news, whatever its number does meanwhile.
    """
    old, new = ({_key(finding) for finding in state.findings} for state in (before, after))
    came = tuple(Entry(after.t, f, began=True) for f in after.findings if _key(f) not in old)
    went = tuple(Entry(after.t, f, began=False) for f in before.findings if _key(f) not in new)
    return (*went, *came)


def _key(finding: Finding) -> tuple[Reason, int | None, tuple[str, str] | None]:
    return finding.reason, finding.axis, finding.parts
