"""Numbers, strings and comments as text of C."""

from __future__ import annotations

import math


def double(value: float) -> str:
    """Return ``value`` as a constant of type double, exactly."""
    if math.isinf(value):
        return "HUGE_VAL" if value > 0.0 else "-HUGE_VAL"
    return repr(float(value) + 0.0)


def text(value: str) -> str:
    """Return ``value`` as a string literal, with any characters."""
    plain = (
        chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in value.encode()
    )
    return f'"{"".join(plain)}"'


def comment(value: str) -> str:
    """Return ``value`` as it can stand in a comment."""
    return value.replace("*/", "* /").replace("/*", "/ *").replace("\n", " ").replace("\\", "/")
