"""Every word a person reads about the state of the arm, keyed by the enums of the core."""

from __future__ import annotations

import math
from collections.abc import Callable

from app.control.state import Finding, Reason, State, Status

AXIS_NAMES = ("base turn", "shoulder", "elbow", "wrist bend", "wrist roll")


def degrees(angle: float, digits: int = 1) -> str:
    """An angle [rad] as people read it; a true minus sign, never "−0"."""
    return signed(math.degrees(angle), digits) + "°"


def millimetres(length: float, digits: int = 1) -> str:
    """A length [m] as people read it."""
    return signed(1e3 * length, digits) + " mm"


def signed(value: float, digits: int) -> str:
    """A number with ``digits`` decimals, a true minus sign and no negative zero."""
    text = f"{abs(value):.{digits}f}"
    return "−" + text if value < 0 and float(text) != 0.0 else text


def axis(number: int | None) -> str:
    """An axis counted from 0, as people count it."""
    return "an axis" if number is None else f"axis {number + 1}"


REASONS: dict[Reason, Callable[[Finding], str]] = {
    Reason.OUT_OF_REACH: lambda f: f"{_short(1e3 * f.amount)} mm out of reach",
    Reason.AXIS_LIMIT: lambda f: f"{axis(f.axis)} at its limit of {degrees(f.amount, 2)}",
    Reason.GRIPPER_LIMIT: lambda f: f"the gripper at its limit of {degrees(f.amount)}",
    Reason.YAW_FIXED: lambda f: (
        f"wrist yaw is fixed by position: {_short(math.degrees(f.amount))}° off"
    ),
    Reason.PITCH_CHANGED: lambda f: (
        f"pitch gives way by {_short(math.degrees(f.amount))}° to keep the position"
    ),
    Reason.ROLL_CHANGED: lambda f: f"roll stops {_short(math.degrees(f.amount))}° short",
    Reason.INTERNAL: lambda _: "something went wrong inside: the arm holds; see the server's log",
}

STATUS: dict[Status, str] = {
    Status.OK: "On target",
    Status.LIMITED: "As near as it can",
    Status.FAULT: "Fault",
}

MOVING = "Moving"


def headline(state: State) -> str:
    """Two or three words for the state of the arm."""
    if state.moving and state.status is Status.OK:
        return MOVING
    return STATUS[state.status]


def sentence(state: State) -> str:
    """Why the arm does not do what was wished, in one sentence; empty when it does."""
    if not state.findings:
        return ""
    said = "; ".join(REASONS[finding.reason](finding) for finding in state.findings)
    return said[0].upper() + said[1:] + "."


def _short(value: float) -> str:
    """Enough digits to act on: none from 10 up, one below."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.1f}"
