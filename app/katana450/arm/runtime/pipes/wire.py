"""Serialization of snapshots for the pipe, in which large unchanged values are sent once.

A plan from the front end goes back as its number. There it becomes the same object that was sent,
with the bodies that it was made for. The solid of a mesh is sent completely at first, and then as
its key for as long as it is in every message.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.solid import Solid
from katana450.maths.planning.plan import Plan

MAX_NAMED_PLANS, MAX_STORED_PLANS = 8, 32
"""Number of plans that the arm's end (8) and the front end (32) remember. The end that names the
plans keeps fewer than the end that looks the names up."""


def plan_of(command: cmd.Command) -> Plan | None:
    """Return the plan that ``command`` makes the arm follow; None if there is none."""
    match command:
        case cmd.Follow(plan=plan):
            return plan
        case cmd.RestoreState(state=state) if state.following is not None:
            return state.following.plan
    return None


class PlanNames:
    """Serializer at the arm's end, which follows plans.

    It knows the numbers of the newest plans that came in, and the solids in the last message.
    """

    def __init__(self) -> None:
        self._known: dict[int, tuple[int, Plan]] = {}
        self._solids: frozenset[str] = frozenset()

    def note(self, number: int, plan: Plan) -> None:
        """Record that ``plan`` came in as ``number``."""
        self._known[id(plan)] = number, plan
        while len(self._known) > MAX_NAMED_PLANS:
            self._known.pop(next(iter(self._known)))

    def dumped(self, value: Any) -> bytes:
        """Return ``value`` as bytes, with its plans replaced by their numbers."""
        file = io.BytesIO()
        pickler = _Pickler(file, self._known, self._solids)
        pickler.dump(value)
        self._solids = frozenset(pickler.solids)
        return file.getvalue()


class PlanStore:
    """Deserializer at the front end, which makes plans.

    It knows the newest plans that were sent, by their numbers, and the solids in the last message.
    """

    def __init__(self) -> None:
        self._sent: dict[int, Plan] = {}
        self._solids: dict[str, Solid] = {}

    def note(self, number: int, plan: Plan) -> None:
        """Record that ``plan`` is sent as ``number``."""
        self._sent[number] = plan
        while len(self._sent) > MAX_STORED_PLANS:
            self._sent.pop(next(iter(self._sent)))

    def loaded(self, data: bytes) -> Any:
        """Return the value in ``data``. Every message must be loaded, in the order of dumping."""
        unpickler = _Unpickler(io.BytesIO(data), self._sent, self._solids)
        value = unpickler.load()
        self._solids = unpickler.solids
        return value


class _Pickler(pickle.Pickler):
    def __init__(
        self, file: io.BytesIO, known: dict[int, tuple[int, Plan]], sent_keys: frozenset[str]
    ) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._known = known
        self._there = sent_keys
        self.solids: set[str] = set()

    def persistent_id(self, value: Any) -> Any:
        if isinstance(value, Plan):
            entry = self._known.get(id(value))
            return None if entry is None else entry[0]
        if not isinstance(value, Solid):
            return None
        known = value.key in self._there or value.key in self.solids
        self.solids.add(value.key)
        return (value.key,) if known else (value.key, value.size, value.corners)


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, sent: dict[int, Plan], solids: dict[str, Solid]) -> None:
        super().__init__(file)
        self._sent = sent
        self._here = solids
        self.solids: dict[str, Solid] = {}

    def persistent_load(self, named: Any) -> Any:
        if isinstance(named, int):
            return self._sent[named]
        key = named[0]
        if key not in self.solids:
            self.solids[key] = Solid(*named) if len(named) > 1 else self._here[key]
        return self.solids[key]
