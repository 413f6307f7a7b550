"""A state of an earlier run that becomes the present one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.state.modes import Following, Intent, Jogging, Leaving, Mode, Servoing
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.maths.motion.limiter import Limits
from katana450.maths.motion.stream import braked

ROUNDING = 1e-6
"""Fraction of each limit by which a restored state may be beyond it; more is no rounding."""


def check_restored(limits: Limits, state: State) -> None:
    """Raise InputError unless ``state`` is one of a robot with ``limits``, and within them."""
    n, motion = len(limits.lower), state.motion
    for values in (state.q, state.goal, motion.q, motion.qd, motion.qdd):
        if values.shape != (n,) or not np.isfinite(values).all():
            raise InputError(f"The state is not of this robot, which has {n} joints.")
    fingers = state.gripper, state.gripper_setpoint, state.gripper_goal
    if not np.isfinite([state.t, state.squeeze, *fingers]).all():
        raise InputError("The state has numbers that are not finite.")
    if not 0.0 < state.speed <= 1.0:
        raise InputError(f"The state has the speed {state.speed}, which is not from 0 to 1.")
    margin = ROUNDING * (limits.upper - limits.lower)
    lower, upper = limits.lower - margin, limits.upper + margin
    halt = braked(motion.q, motion.qd, motion.qdd, limits.acceleration, limits.jerk)
    for name, values, low, high in (
        ("position", motion.q, lower, upper),
        ("goal", state.goal, lower, upper),
        ("braking distance", halt, lower, upper),
        ("speed", motion.qd, -limits.speed, limits.speed),
        ("acceleration", motion.qdd, -limits.acceleration, limits.acceleration),
    ):
        spare = ROUNDING * np.abs(high)
        beyond = (values < low - spare) | (values > high + spare)
        if beyond.any():
            joint = int(np.argmax(beyond)) + 1
            raise InputError(
                f"The {name} of joint {joint} in the state is beyond its limit. It was recorded "
                "with other limits."
            )


def restored(state: State, t: float) -> State:
    """Return ``state`` as if its time were ``t`` [s]: it continues as it did then.

    The arm is at the setpoint, also if the state is one of a real arm that lagged behind it.
    """
    return replace(
        state,
        t=t,
        q=state.setpoint,
        gripper=state.gripper_setpoint,
        mode=_later(state.mode, t - state.t),
        report=None,
        astray_since=None,
    )


def _later(mode: Mode, by: float) -> Mode:
    """Return ``mode`` with all its times later by ``by`` [s]."""
    match mode:
        case Following():
            return mode
        case Leaving(along=along, then=then):
            return Leaving(along, _intent_later(then, by))
    return _intent_later(mode, by)


def _intent_later(intent: Intent, by: float) -> Intent:
    match intent:
        case Jogging():
            return replace(intent, until=intent.until + by)
        case Servoing(stream=stream):
            return Servoing(replace(stream, times=stream.times + by))
    return intent
