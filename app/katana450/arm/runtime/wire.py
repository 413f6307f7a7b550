"""How snapshots cross the pipe: what is large and does not change crosses once.

A plan that came from the other end goes back as its number, and over there it is the very plan
that was sent, with the bodies it was made for. The solid of a mesh goes whole at first, and as its
key for as long as it is in every message.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

from katana450.arm.control.solid import Solid
from katana450.maths.planning.plan import Plan

KEPT_HERE, KEPT_THERE = 8, 32
"""Plans remembered: fewer where they are named than where the names are understood."""


class PlanNames:
    """At the end that follows plans: numbers of the newest that came in, and what was last sent."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[int, Plan]] = {}
        self._solids: frozenset[str] = frozenset()

    def note(self, number: int, plan: Plan) -> None:
        """``plan`` came as ``number``."""
        self._known[id(plan)] = number, plan
        while len(self._known) > KEPT_HERE:
            self._known.pop(next(iter(self._known)))

    def dumped(self, value: Any) -> bytes:
        """``value`` as bytes, its plans by their numbers."""
        file = io.BytesIO()
        pickler = _Pickler(file, self._known, self._solids)
        pickler.dump(value)
        self._solids = frozenset(pickler.solids)
        return file.getvalue()


class PlanStore:
    """At the end that makes plans: the newest that went out by their numbers; what last came."""

    def __init__(self) -> None:
        self._sent: dict[int, Plan] = {}
        self._solids: dict[str, Solid] = {}

    def note(self, number: int, plan: Plan) -> None:
        """``plan`` goes as ``number``."""
        self._sent[number] = plan
        while len(self._sent) > KEPT_THERE:
            self._sent.pop(next(iter(self._sent)))

    def loaded(self, data: bytes) -> Any:
        """What ``data`` holds; each message is to be loaded, in the order they were dumped."""
        unpickler = _Unpickler(io.BytesIO(data), self._sent, self._solids)
        value = unpickler.load()
        self._solids = unpickler.solids
        return value


class _Pickler(pickle.Pickler):
    def __init__(
        self, file: io.BytesIO, known: dict[int, tuple[int, Plan]], there: frozenset[str]
    ) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._known = known
        self._there = there
        self.solids: set[str] = set()

    def persistent_id(self, value: Any) -> Any:
        if isinstance(value, Plan):
            found = self._known.get(id(value))
            return None if found is None else found[0]
        if not isinstance(value, Solid):
            return None
        told = value.key in self._there or value.key in self.solids
        self.solids.add(value.key)
        return (value.key,) if told else (value.key, value.size, value.corners)


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, sent: dict[int, Plan], here: dict[str, Solid]) -> None:
        super().__init__(file)
        self._sent = sent
        self._here = here
        self.solids: dict[str, Solid] = {}

    def persistent_load(self, named: Any) -> Any:
        if isinstance(named, int):
            return self._sent[named]
        key = named[0]
        if key not in self.solids:
            self.solids[key] = Solid(*named) if len(named) > 1 else self._here[key]
        return self.solids[key]
