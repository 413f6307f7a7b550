"""Content of records: acts and other values as values of JSON.

The process that writes the log loads nothing of this: it has no acts.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import Act, content_names
from katana450.assembly.event_log.records import text
from katana450.maths.planning.plan import Plan

MAX_ITEMS = 16
"""Maximum number of items of a list or of fields in a record; a pose has 16 numbers."""

MAX_DEPTH = 3
"""Maximum depth of values in values; what is deeper is left out."""

SECRETS = frozenset({"token", "key", "cookie", "authorization"})
"""Names of fields whose values are never recorded."""


def content_of(what: Any) -> Any:
    """Return ``what``, an act or another value, as a JSON value of bounded size."""
    if not isinstance(what, Act):
        return _bounded(_plain(what))
    if isinstance(what, cmd.Batch):
        parts = [content_of(part) for part in what.parts[:MAX_ITEMS]]
        return {"command": "Batch", "count": len(what.parts), "parts": parts}
    kind = "command" if isinstance(what, cmd.Command) else "request"
    fields = {name: _plain(getattr(what, name)) for name in content_names(type(what))}
    return {kind: type(what).__name__, **_bounded(fields)}


def _plain(value: Any) -> Any:
    """Return ``value`` made of the types of JSON; of a plan its duration alone."""
    if isinstance(value, Plan):
        return {"seconds": value.duration}
    return msgspec.to_builtins(value, enc_hook=_described, str_keys=True)


def _described(value: Any) -> Any:
    """Return what a record holds of a value that msgspec does not know."""
    match value:
        case np.generic():
            return value.item()
        case np.ndarray():
            # A mesh has thousands, which are not copied.
            few = value.size <= MAX_ITEMS
            return value.ravel().tolist() if few else f"{value.size} values"
    return type(value).__name__


def _bounded(value: Any, depth: int = 0) -> Any:
    """Return ``value`` of bounded size, without secrets. Numbers have six digits."""
    match value:
        case float():
            number = float(f"{value:.6g}")
            # JSON has no infinity.
            return number if abs(number) < float("inf") else str(value)
        case str():
            return text(value)
        case dict() | list() | tuple() if depth >= MAX_DEPTH:
            return "..."
        case dict():
            fields = [(text(name), entry) for name, entry in value.items() if name not in SECRETS]
            return {
                name: _bounded(entry, depth + 1)
                for name, entry in fields[:MAX_ITEMS]
                if entry is not None
            }
        case list() | tuple() if len(value) > MAX_ITEMS:
            return f"{len(value)} values"
        case list() | tuple():
            return [_bounded(entry, depth + 1) for entry in value]
    return value
