"""Velocities of the arm: jogging, speed of the tool point, and distance from singularities.

A twist has two units, so singular values need a length to be comparable: translations are divided
by the arm's characteristic length. Twists are (omega, v), with v the velocity of the tool point.

Sources: Nakamura & Hanafusa (1986) for the damping; Lynch & Park, Modern Robotics (2017), ch. 5.3
and 5.4.
"""

from __future__ import annotations

import math
from enum import Enum
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry import screws
from katana450.maths.geometry.arrays import FloatArray, finite_array
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import jacobian_body, tool_and_jacobian

WELL_CONDITIONED: Final = 0.05
"""Singular value [1] from which on joint rates are not damped."""

STRONGEST_DAMPING: Final = 0.05
"""Damping [1] where a singular value is 0; it falls to zero at WELL_CONDITIONED. Joint rates for a
unit twist stay below 1.21 / WELL_CONDITIONED, little above their values where damping begins.
"""


SLOW: Final = 1e-3
"""A task velocity [rad/s] (translations over the length) within every joint's speed; also a short
duration [s].
"""


ALL_FREEDOMS: Final = 6
"""Number of axes from which on an arm can follow every twist."""


class JogFrame(Enum):
    """The frame of a jog's axes; the linear velocity is that of the tool point in both frames."""

    BASE = "base"
    TOOL = "tool"


@lru_cache(maxsize=16)
def characteristic_length(chain: Chain) -> float:
    """Return the root mean square distance [m] of the tool point from the joint axes at q = 0.

    Over this length, a joint rate moves the tool by about as much as it turns it.
    """
    p = chain.M[:3, 3]
    arms = [np.linalg.norm(np.cross(axis[:3], p - screws.point_on(axis))) for axis in chain.S.T]
    return float(np.sqrt(np.mean(np.square(arms))))


def singular_values(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the singular values (n,) [1] of the Jacobian at `q` (n,) [rad], in falling order.

    The last one is 0 in a singularity.
    """
    J = jacobian_body(chain, q)
    J[3:] /= characteristic_length(chain)
    return np.asarray(np.linalg.svd(J, compute_uv=False))


def limit_distances(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the distance (n,) [rad] of each joint from its nearer limit; negative beyond it."""
    q = chain.check_q(q)
    return np.minimum(q - chain.lower, chain.upper - q)


def nearest_limit(chain: Chain, distances: FloatArray) -> int:
    """Return the axis, from 0, of the least of `limit_distances`, of those that are angles."""
    return int(np.where(chain.slides, math.inf, distances).argmin())


def jog(
    chain: Chain,
    q: npt.ArrayLike,
    V: npt.ArrayLike,
    frame: JogFrame,
    dt: float,
    *,
    bounds: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Return the joint rates (n,) [rad/s] that move the tool with the twist `V` (6,).

    The unit of `V` is [rad/s, m/s]. Fewer than six axes follow only the rotation about their axes
    from the fourth on, such as those of pitch and of roll; the rest follows from the path of the
    tool. Damped least squares keep the
    rates bounded near a singularity, where only motion along the lost direction is lost. A joint
    that would pass its limit within `dt` [s] stops there, and the others compensate as far as they
    can. If a joint would be too fast, all are slowed by the same factor, so the direction is kept.

    Args:
        chain: the arm.
        q: joint angles (n,) [rad].
        V: twist (6,) in `frame`.
        frame: the frame of the twist.
        dt: duration of the jog [s].
        bounds: additional minimum and maximum rate (n,) [rad/s] of each joint, around 0. They bound
            a joint with inertia that approaches its limit.

    Raises:
        InputError: `q` or `V` is invalid, or `dt` is not above 0.
    """
    if not (math.isfinite(dt) and dt > 0.0):
        raise InputError(f"The duration of a jog must be finite and above 0 s, not {dt:g} s.")
    q = chain.check_q(q)
    V = finite_array(V, (6,), "The twist")
    J, wanted = _task(chain, q, V, frame)
    # Slowed before the limits are checked: motion that the arm is too slow for reaches no limit.
    wanted /= _excess(chain, _damped(J, wanted))
    # A joint beyond its limit may return, but need not.
    maximum = np.maximum((chain.upper - q) / dt, 0.0)
    minimum = np.minimum((chain.lower - q) / dt, 0.0)
    if bounds is not None:
        minimum, maximum = np.maximum(minimum, bounds[0]), np.minimum(maximum, bounds[1])
    qd = np.zeros(chain.n)
    free = np.ones(chain.n, dtype=np.bool_)
    while free.any():
        qd[free] = _damped(J[:, free], wanted - J[:, ~free] @ qd[~free])
        over = np.where(free, np.maximum(qd - maximum, minimum - qd), -math.inf)
        worst = int(over.argmax())
        if over[worst] <= 0.0:
            break
        qd[worst] = min(max(qd[worst], minimum[worst]), maximum[worst])
        free[worst] = False
    return qd / _excess(chain, qd)


def coasted(chain: Chain, q: FloatArray, qd: FloatArray, dt: float) -> FloatArray:
    """Return the joint rates (n,) [rad/s] after `dt` [s] with which the tool keeps its twist.

    The twist is that of the rates `qd` (n,) [rad/s] at `q` (n,) [rad]: the velocity of the tool
    point in {S}, and the rotation that the arm can follow, see `jog`: of fewer than six axes that
    about their own. Near a singularity it is kept as far as the damping allows.
    """
    after = q + dt * qd
    (J, R, _), (J_after, R_after, _) = (_freedoms(chain, angles) for angles in (q, after))
    wanted = J @ qd
    wanted[-3:] = R_after.T @ R @ wanted[-3:]
    if chain.n >= ALL_FREEDOMS:
        wanted[:3] = R_after.T @ R @ wanted[:3]
    return qd + _damped(J_after, wanted - J_after @ qd)


def limited_jog(
    chain: Chain,
    q: FloatArray,
    V: FloatArray,
    edge: float | None = None,
) -> float:
    """Return the fraction, from 0 to 1, of the twist `V` (6,) in {S} that a jog can follow.

    The speed of the twist does not count; `q` (n,) are joint angles [rad]. A joint nearer than
    `edge` [rad] to a limit does not move towards it; None ignores limits.
    """
    J, wanted = _task(chain, q, V, JogFrame.BASE)
    size = float(wanted @ wanted)
    if size == 0.0:
        return 1.0
    if edge is None:
        return float(wanted @ (J @ _damped(J, wanted))) / size
    minimum = np.where(q - chain.lower > edge, -chain.speed, 0.0)
    maximum = np.where(chain.upper - q > edge, chain.speed, 0.0)
    slow = SLOW / math.sqrt(size)
    qd = jog(chain, q, slow * V, JogFrame.BASE, SLOW, bounds=(minimum, maximum))
    return float(wanted @ (J @ qd)) / (slow * size)


def tool_speed(chain: Chain, q: FloatArray, qd: FloatArray) -> float:
    """Return the speed of the tool point [m/s] at `q` (5,) [rad] with the rates `qd` (5,) [rad/s].

    Uses plain floats, for a control tick. Exact for a tool point on the roll axis; for one beside
    the axis this is an upper bound.
    """
    arm = arm_of(chain)
    _, two, three, four, _ = arm.canonical(q).tolist()
    pan, first, second, third, roll = (qd * arm.signs).tolist()
    second += first
    third += second
    three += two
    four += three
    # In the arm's plane: u outward, v down.
    u = arm.a + arm.l1 * math.cos(two) + arm.l2 * math.cos(three) + arm.l3 * math.cos(four)
    du = -first * arm.l1 * math.sin(two) - second * arm.l2 * math.sin(three)
    du -= third * arm.l3 * math.sin(four)
    dv = first * arm.l1 * math.cos(two) + second * arm.l2 * math.cos(three)
    dv += third * arm.l3 * math.cos(four)
    offset_speed = arm.off_axis * (abs(pan) + abs(third) + abs(roll)) if arm.off_axis else 0.0
    return math.hypot(du - pan * arm.d, pan * u, dv) + offset_speed


def tool_speed_bound(chain: Chain, qd: FloatArray) -> float:
    """Return the maximum of `tool_speed` [m/s] over all postures.

    `qd` (5,) are the maximum joint rates [rad/s].
    """
    arm = arm_of(chain)
    pan, first, second, third, roll = np.abs(qd).tolist()
    l2, l3 = arm.l2 + arm.l3, arm.l3
    reach: float = abs(arm.a) + arm.l1 + l2
    plane: float = first * (arm.l1 + l2) + second * l2 + third * l3
    offset_speed: float = arm.off_axis * (pan + first + second + third + roll)
    return math.hypot(pan * reach, plane + pan * abs(arm.d)) + offset_speed


def _excess(chain: Chain, qd: FloatArray) -> float:
    """Return the factor, at least 1, by which `qd` (n,) [rad/s] is too fast for the joints."""
    return max(1.0, float((np.abs(qd) / chain.speed).max()))


def _task(
    chain: Chain, q: FloatArray, V: FloatArray, frame: JogFrame
) -> tuple[FloatArray, FloatArray]:
    """Return Jacobian (k, n) and task (k,): the rotation that counts, and v over a length.

    All components are in the tool frame, at the tool point.
    """
    J, R, axes = _freedoms(chain, q)
    omega, v = (V[:3], V[3:]) if frame is JogFrame.TOOL else (R.T @ V[:3], R.T @ V[3:])
    return J, np.concatenate((axes @ omega, v / characteristic_length(chain)))


def _freedoms(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the Jacobian (k, n) of a task, R (3, 3) of the tool, and the axes (k - 3, 3) in it.

    About these axes the arm can turn its tool: all three from six axes on, else those from the
    fourth on.
    """
    return _freedoms_at(chain, q.tobytes())


# A tick asks for the same posture up to three times: where it begins, coasts to, and is judged.
@lru_cache(maxsize=8)
def _freedoms_at(chain: Chain, angles: bytes) -> tuple[FloatArray, FloatArray, FloatArray]:
    T, J = tool_and_jacobian(chain, np.frombuffer(angles))
    J[3:] /= characteristic_length(chain)
    axes = np.eye(3) if chain.n >= ALL_FREEDOMS else J[:3, 3:].T
    freedoms = np.concatenate((axes @ J[:3], J[3:]))
    for array in (freedoms, T, axes):
        array.setflags(write=False)
    return freedoms, T[:3, :3], axes


def _damped(J: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the rates for `wanted`, with damping where a singular value vanishes."""
    U, values, Vt = np.linalg.svd(J, full_matrices=False)
    shortfall = np.clip(1.0 - values / WELL_CONDITIONED, 0.0, 1.0)
    square = np.square(STRONGEST_DAMPING * shortfall)
    gain = np.divide(values, values**2 + square)
    return np.asarray(Vt.T @ (gain * (U.T @ wanted)))
