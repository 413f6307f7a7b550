"""Limits of the records that one participant can cause: more of them are counted, not written.

So nobody can quickly fill the log, or displace older records by new ones.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from katana450.extensions.event_log.records import Record
from katana450.server.web.token_bucket import TokenBucket

SUMMARY_INTERVAL = 10.0
"""[s] Time between two summaries of what was not written."""

MAX_SOURCES = 256
"""Maximum number of participants with limits of their own; others share the total limit."""

TOTAL = 4.0
"""Limit of all participants together, in limits of one."""


class RecordLimit(NamedTuple):
    """Records that are written in a burst, and per second afterwards."""

    burst: float
    rate: float


LIMITS = {
    "command": RecordLimit(600.0, 2.0),
    "stop": RecordLimit(30.0, 0.5),
    "lease": RecordLimit(60.0, 0.5),
    "finding": RecordLimit(200.0, 1.0),
    "session": RecordLimit(60.0, 0.2),
    "refusal": RecordLimit(20.0, 0.2),
}
"""Limits by groups of kinds. A flood in one group leaves the others as they are."""

GROUPS = {
    "stop": "stop",
    "clear": "stop",
    "lease": "lease",
    "finding": "finding",
    "join": "session",
    "leave": "session",
    "rename": "session",
    "sign-in": "session",
    "upload": "session",
    "refusal": "refusal",
}
"""Groups of the kinds of records; all others are in ``command``."""


@dataclass
class _Account:
    """Records that one participant may cause now, and those that were not written."""

    records: TokenBucket
    since: float = 0.0
    who: Any = None
    unwritten: Counter[str] = field(default_factory=Counter)

    @staticmethod
    def of(limit: RecordLimit, t: float, factor: float = 1.0) -> _Account:
        """Return an account for ``factor`` times the records of ``limit``, full at ``t`` [s]."""
        return _Account(TokenBucket(factor * limit.rate, factor * limit.burst, t))


class RecordLimits:
    """Limits by participant and group of kinds, and for all participants by group."""

    def __init__(self) -> None:
        self._accounts: OrderedDict[tuple[str, str], _Account] = OrderedDict()
        self._totals: dict[str, _Account] = {}

    def admits(self, source: str, record: Record, t: float) -> bool:
        """Return whether ``record`` of ``source`` is written at ``t`` [s]; count it otherwise."""
        group = GROUPS.get(record["kind"], "command")
        limit = LIMITS[group]
        total = self._totals.setdefault(group, _Account.of(limit, t, TOTAL))
        own = self._accounts.pop((source, group), None) or _Account.of(limit, t)
        self._accounts[source, group] = own
        self._forget_some()
        if own.records.take(t) and total.records.take(t):
            return True
        if not own.unwritten:
            own.since, own.who = t, record.get("who")
        own.unwritten[_label(record)] += 1
        return False

    def summaries(self, t: float, *, all_now: bool = False) -> list[Record]:
        """Return the summaries that are due at ``t`` [s], or all of them."""
        due: list[Record] = []
        for account in (*self._accounts.values(), *self._totals.values()):
            if account.unwritten and (all_now or t - account.since >= SUMMARY_INTERVAL):
                due.append(_summary(account, t))
                account.unwritten = Counter()
        return due

    @property
    def counts(self) -> bool:
        """True if a summary will be due."""
        accounts = (*self._accounts.values(), *self._totals.values())
        return any(account.unwritten for account in accounts)

    def _forget_some(self) -> None:
        while len(self._accounts) > MAX_SOURCES:
            (_, group), old = self._accounts.popitem(last=False)
            total = self._totals[group]
            if old.unwritten and not total.unwritten:
                total.since, total.who = old.since, {"name": "several participants"}
            total.unwritten += old.unwritten


def _label(record: Record) -> str:
    """Return the kind of ``record``, with the name of its command or request."""
    what = record.get("what")
    name = ""
    if isinstance(what, dict):
        name = what.get("command") or what.get("request") or what.get("lease") or ""
    return f"{record['kind']} {name}".strip()


def _summary(account: _Account, t: float) -> Record:
    what = {
        "count": account.unwritten.total(),
        "seconds": round(t - account.since, 1),
        "of": dict(account.unwritten.most_common(8)),
    }
    return {"kind": "more", "what": what, "t": round(t, 3)} | (
        {} if account.who is None else {"who": account.who}
    )
