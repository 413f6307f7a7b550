"""Compact values of commands and requests for the event log: bounded, and without secrets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import msgspec
import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.act import Act, content_names
from katana450.maths.planning.plan import Plan

MAX_TEXT = 200
"""Maximum length of a text in a record, in characters."""

MAX_ITEMS = 16
"""Maximum number of items of a list or of fields in a record; a pose has 16 numbers."""

MAX_DEPTH = 3
"""Maximum depth of values in values; what is deeper is left out."""

SECRETS = frozenset({"token", "key", "cookie", "authorization"})
"""Names of fields whose values are never recorded."""


def text(value: object) -> str:
    """Return ``value`` as a text of at most ``MAX_TEXT`` characters."""
    found = value if isinstance(value, str) else str(value)
    return found if len(found) <= MAX_TEXT else f"{found[:MAX_TEXT]}... ({len(found)} characters)"


def compact_act(act: Act) -> dict[str, Any]:
    """Return the name of ``act`` and its values."""
    if isinstance(act, cmd.Batch):
        parts = [compact_act(part) for part in act.parts[:MAX_ITEMS]]
        return {"command": "Batch", "count": len(act.parts), "parts": parts}
    kind = "command" if isinstance(act, cmd.Command) else "request"
    content = {kind: type(act).__name__, **_fields(act, 0)}
    if isinstance(act, cmd.SetAxes):
        content["values"] = {str(axis): _number(value) for axis, value in act.values}
    return content


def compact(value: Any, depth: int = 0) -> Any:
    """Return ``value`` as a JSON value of bounded size. Numbers have six digits."""
    match value:
        case None | bool() | int():
            return value
        case float() | np.floating():
            return _number(float(value))
        case str():
            return text(value)
        case Enum():
            return value.name.lower()
        case Plan():
            return {"seconds": _number(value.duration)}
        case np.ndarray():
            return _items(value.ravel().tolist()) if value.size <= MAX_ITEMS else _count(value.size)
    if depth >= MAX_DEPTH:
        return "..."
    match value:
        case Mapping():
            kept = list(value.items())[:MAX_ITEMS]
            return {text(key): compact(each, depth + 1) for key, each in kept}
        case tuple() | list() | frozenset() | set():
            if len(value) > MAX_ITEMS:
                return _count(len(value))
            return [compact(each, depth + 1) for each in value]
    return _fields(value, depth) or text(type(value).__name__)


def _fields(value: Any, depth: int) -> dict[str, Any]:
    """Return the fields of ``value`` that are set and no secrets."""
    names: Sequence[str]
    if isinstance(value, Act):
        names = content_names(type(value))
    elif isinstance(value, msgspec.Struct):
        names = value.__struct_fields__
    elif is_dataclass(value):
        names = [field.name for field in fields(value) if field.repr]
    else:
        return {}
    found = ((name, getattr(value, name)) for name in names[:MAX_ITEMS] if name not in SECRETS)
    return {name: compact(each, depth + 1) for name, each in found if each is not None}


def _items(values: list[Any]) -> list[Any]:
    return [compact(each) for each in values]


def _count(count: int) -> str:
    return f"{count} values"


def _number(value: float) -> float | str:
    number = float(f"{value:.6g}")
    # JSON has no infinity.
    return number if abs(number) < float("inf") else str(value)
