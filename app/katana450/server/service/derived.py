"""Answers that follow from a snapshot alone, worked out once for everybody who asks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from katana450.arm.runtime.state_publisher import Snapshot

T = TypeVar("T")

_FOUND: WeakKeyDictionary[Snapshot, dict[str, Any]] = WeakKeyDictionary()
"""By snapshot and name; they go with the snapshot. For the gateway's thread alone."""


def once(snapshot: Snapshot, name: str, work: Callable[[], T]) -> T:
    """Return what ``work`` made when ``name`` was first asked of ``snapshot``.

    An error is raised and not kept.
    """
    found = _FOUND.setdefault(snapshot, {})
    if name not in found:
        found[name] = work()
    value: T = found[name]
    return value
