"""Cache of answers that depend on a snapshot alone, shared by all clients."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from katana450.arm.runtime.state_publisher import Snapshot

T = TypeVar("T")

_FOUND: WeakKeyDictionary[Snapshot, dict[str, Any]] = WeakKeyDictionary()
"""Values by snapshot and name, dropped with the snapshot. For the gateway's thread alone."""


def once(snapshot: Snapshot, name: str, work: Callable[[], T]) -> T:
    """Return the result of ``work``, computed at the first request of ``name`` for ``snapshot``.

    An error is raised and not kept.
    """
    found = _FOUND.setdefault(snapshot, {})
    if name not in found:
        found[name] = work()
    value: T = found[name]
    return value
