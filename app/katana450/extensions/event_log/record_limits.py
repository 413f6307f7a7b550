"""Limits of the records that one participant can cause: more of them are counted, not written.

So nobody can quickly fill the log, or displace older records by new ones.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from typing import Any

from katana450.extensions.event_log.records import Record
from katana450.server.web.limits import TokenBucket

SUMMARY_INTERVAL = 10.0
"""[s] Time between two summaries of what was not written."""

MAX_ACCOUNTS = 512
"""Maximum number of accounts; beyond it the oldest ones are counted with all others."""

SESSION = (60.0, 0.2)

LIMITS = {
    "stop": (30.0, 0.5),
    "clear": (30.0, 0.5),
    "lease": (60.0, 0.5),
    "finding": (200.0, 1.0),
    "outcome": (200.0, 1.0),
    "refusal": (20.0, 0.2),
    **dict.fromkeys(("join", "leave", "rename", "sign-in", "upload"), SESSION),
}
"""Records of one participant in a burst, and per second [1/s] afterwards, by kind. A flood of one
kind leaves the others as they are."""

COMMANDS = (600.0, 2.0)
"""The same for all other kinds."""

EVERYBODY, EVERYBODY_FACTOR = "everybody", 4.0
"""Source of the records of all participants together, and their limits in limits of one."""


class _Account:
    """Records of one kind that one participant may cause now, and those that were not written."""

    def __init__(self, kind: str, factor: float, t: float) -> None:
        burst, rate = LIMITS.get(kind, COMMANDS)
        self.records = TokenBucket(factor * rate, factor * burst, t)
        self.since = t
        self.who: Any = None
        self.unwritten: Counter[str] = Counter()

    def add(self, unwritten: Counter[str], who: Any, t: float) -> None:
        """Count records that are not written since ``t`` [s]."""
        if not self.unwritten:
            self.since, self.who = t, who
        self.unwritten += unwritten

    def summary(self, t: float) -> Record:
        """Return the record of what was not written up to ``t`` [s], and count from zero."""
        counts, self.unwritten = self.unwritten, Counter()
        seconds = round(t - self.since, 1)
        what = {"count": counts.total(), "seconds": seconds, "of": dict(counts.most_common(8))}
        return {"kind": "more", "what": what, "t": round(t, 3), "who": self.who}


class RecordLimits:
    """Limits by participant and kind, and for all participants by kind."""

    def __init__(self) -> None:
        self._accounts: OrderedDict[tuple[str, str], _Account] = OrderedDict()

    def admits(self, source: str, record: Record, t: float) -> bool:
        """Return whether ``record`` of ``source`` is written at ``t`` [s]; count it otherwise."""
        kind = record["kind"]
        own, total = self._account(source, kind, t), self._account(EVERYBODY, kind, t)
        if own.records.take(t) and total.records.take(t):
            return True
        own.add(Counter([_label(record)]), record.get("who"), t)
        return False

    def summaries(self, t: float, *, all_now: bool = False) -> list[Record]:
        """Return the summaries that are due at ``t`` [s], or all of them."""
        return [
            account.summary(t)
            for account in self._accounts.values()
            if account.unwritten and (all_now or t - account.since >= SUMMARY_INTERVAL)
        ]

    @property
    def counts(self) -> bool:
        """True if a summary will be due."""
        return any(account.unwritten for account in self._accounts.values())

    def _account(self, source: str, kind: str, t: float) -> _Account:
        """Return an account, as the newest one."""
        factor = EVERYBODY_FACTOR if source == EVERYBODY else 1.0
        account = self._accounts.pop((source, kind), None) or _Account(kind, factor, t)
        self._accounts[source, kind] = account
        if len(self._accounts) > MAX_ACCOUNTS:
            (_, oldest_kind), oldest = self._accounts.popitem(last=False)
            if oldest.unwritten:
                everybody = self._account(EVERYBODY, oldest_kind, t)
                everybody.add(oldest.unwritten, {"name": "several participants"}, oldest.since)
        return account


def _label(record: Record) -> str:
    """Return the kind of ``record``, with the name of its command or request."""
    what = record.get("what")
    name = ""
    if isinstance(what, dict):
        name = what.get("command") or what.get("request") or what.get("lease") or ""
    return f"{record['kind']} {name}".strip()
