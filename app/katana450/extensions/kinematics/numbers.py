"""Numbers in requests on JSON lines, checked one by one so that an error names its place."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any

from katana450.errors import InputError

MAX_SHOWN_CHARACTERS = 40
"""Maximum number of characters of a wrong value that an error message repeats."""


def numbers(request: Mapping[str, Any], key: str, depth: int) -> Any:
    """Return the value of ``key``: lists of JSON numbers, nested ``depth`` deep.

    Raises InputError with the place of a value that is not a number. The caller checks shapes.
    """
    if key not in request:
        raise InputError(f"The key {key!r} is missing.")
    _check_numbers(request[key], key, depth)
    return request[key]


def _check_numbers(value: Any, place: str, depth: int) -> None:
    if depth:
        if not isinstance(value, list):
            what = "numbers" if depth == 1 else "rows"
            raise InputError(f"{place} is {shown(value)}; it must be a list of {what}.")
        for k, each in enumerate(value):
            _check_numbers(each, f"{place}[{k}]", depth - 1)
        if depth == 2 and len({len(row) for row in value}) > 1:
            raise InputError(f"The rows of {place} have different lengths; its shape must be 4x4.")
    elif isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{place} is {shown(value)}; give plain finite numbers.")
    elif isinstance(value, int) and abs(value) > sys.float_info.max:
        raise InputError(f"{place} is too large; give plain finite numbers.")


def shown(value: Any) -> str:
    """Return ``value`` as JSON shows it, shortened."""
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else "a list"
    text = json.dumps(value)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else f"{text[:MAX_SHOWN_CHARACTERS]}..."
