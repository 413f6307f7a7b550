"""How snapshots cross the pipe: a plan that came from the other end goes back as its number.

Plans are large and do not change while they are followed; so each crosses once, and over there it
is the very plan that was sent, with the bodies it was made for.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

from app.planning.plan import Plan

KEPT_HERE, KEPT_THERE = 8, 32
"""Plans remembered: fewer where they are named than where the names are understood."""


class Names:
    """At the end that follows plans: numbers of the newest that came in."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[int, Plan]] = {}

    def note(self, number: int, plan: Plan) -> None:
        """``plan`` came as ``number``."""
        self._known[id(plan)] = number, plan
        while len(self._known) > KEPT_HERE:
            self._known.pop(next(iter(self._known)))

    def dumped(self, value: Any) -> bytes:
        """``value`` as bytes, its plans by their numbers."""
        file = io.BytesIO()
        _Pickler(file, self._known).dump(value)
        return file.getvalue()


class Plans:
    """At the end that makes plans: the newest that went out, by their numbers."""

    def __init__(self) -> None:
        self._sent: dict[int, Plan] = {}

    def note(self, number: int, plan: Plan) -> None:
        """``plan`` goes as ``number``."""
        self._sent[number] = plan
        while len(self._sent) > KEPT_THERE:
            self._sent.pop(next(iter(self._sent)))

    def loaded(self, data: bytes) -> Any:
        """What ``data`` holds."""
        return _Unpickler(io.BytesIO(data), self._sent).load()


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, known: dict[int, tuple[int, Plan]]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._known = known

    def persistent_id(self, value: Any) -> int | None:
        if not isinstance(value, Plan):
            return None
        found = self._known.get(id(value))
        return None if found is None else found[0]


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, sent: dict[int, Plan]) -> None:
        super().__init__(file)
        self._sent = sent

    def persistent_load(self, number: int) -> Plan:
        return self._sent[number]
