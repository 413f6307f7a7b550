"""Forward and inverse kinematics of many poses at once, in chunks that stay in the cache.

The inverse runs the formulas of app/kinematics/closed_form.py on arrays; the few poses with the
tool point next to axis 1, where there are cases to tell apart, go through the scalar `Solver`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from app import tolerances
from app.errors import InputError
from app.geometry import se3
from app.geometry.arrays import FloatArray
from app.kinematics.arm import FiveAxisArm
from app.kinematics.chain import Chain
from app.kinematics.closed_form import Functions, closed_form
from app.kinematics.solver import Solver

BoolArray = npt.NDArray[np.bool_]

CHUNK: Final = 4096
"""Poses at a time: what one step holds of them fits in a megabyte."""


@dataclass(frozen=True, eq=False)
class Solutions:
    """What `inverse_batch` found of N poses; the branches are in the order of BRANCHES.

    q: (N, 4, 5) joint angles [rad]. within_limits: (N, 4) whether they are inside the limits.
    position_error [m], rotation_error [rad]: (N, 4) what forward kinematics of q misses the asked
    poses by; None unless asked for.
    """

    q: FloatArray
    within_limits: BoolArray
    position_error: FloatArray | None = None
    rotation_error: FloatArray | None = None


def forward_batch(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """T_S_tool (N, 4, 4) at the joint angles `q` (N, n) [rad]; as `forward`, pose by pose.

    Raises InputError when `q` is not finite or has another shape.
    """
    q = _numbers(q, (chain.n,), "The joint vectors")
    for pose, axis in np.argwhere(~np.isfinite(q))[:1].tolist():
        raise InputError(
            f"Joint vector {pose} has {q[pose, axis]} for axis {axis + 1}; give angles."
        )
    result = np.empty((len(q), 4, 4))
    for rows in _chunks(len(q)):
        result[rows] = _forward(chain, q[rows].T).transpose(2, 0, 1)
    return result


def inverse_batch(chain: Chain, T: npt.ArrayLike, *, residuals: bool = False) -> Solutions:
    """The four solutions of each pose `T` (N, 4, 4) = T_S_tool [m]; as `inverse`, pose by pose.

    residuals: measure by forward kinematics what each solution misses its pose by.

    Raises InputError for the first pose that cannot be used, RobotDescriptionError for an arm of
    another kind.
    """
    solver = Solver.of(chain)
    T = _numbers(T, (4, 4), "The poses")
    q = np.empty((len(T), 4, 5))
    inside = np.empty((len(T), 4), dtype=np.bool_)
    position = np.empty((len(T), 4)) if residuals else None
    rotation = np.empty((len(T), 4)) if residuals else None
    for rows in _chunks(len(T)):
        asked = _validated(T[rows].transpose(1, 2, 0).copy(), rows.start)
        found = _solve(chain, solver, asked)
        q[rows] = found.transpose(2, 0, 1)
        inside[rows] = _inside(chain, found).T
        if position is not None and rotation is not None:
            for branch in range(4):
                reached = _forward(chain, found[branch])
                position[rows, branch] = np.sqrt(((reached[:3, 3] - asked[:3, 3]) ** 2).sum(axis=0))
                rotation[rows, branch] = _angle(reached, asked)
    return Solutions(q, inside, position, rotation)


def _chunks(n: int) -> Iterator[slice]:
    return (slice(start, min(start + CHUNK, n)) for start in range(0, n, CHUNK))


def _numbers(value: npt.ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    """`value` (N, *shape) as float64, NaN and infinity included; InputError when it is none."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} are not a regular array: {error}.") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} hold {array.dtype} values; give plain finite numbers.")
    if array.ndim != 1 + len(shape) or array.shape[1:] != shape:
        wanted = ", ".join(["N", *map(str, shape)])
        raise InputError(f"{name} have shape {array.shape}; it must be ({wanted}).")
    return array.astype(np.float64, copy=False)


def _validated(T: FloatArray, start: int) -> FloatArray:
    """The poses `T` (4, 4, C), the first the `start`-th, made clean or refused as one by one."""
    x, y, z, p = T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3]
    misfit = np.empty((6, T.shape[2]))
    for row, (a, b) in zip(misfit, ((x, x), (y, y), (x, y)), strict=False):
        np.add(a[0] * b[0] + a[1] * b[1], a[2] * b[2], out=row)
    misfit[:2] -= 1.0
    # The third axis is right-handed: unit length and squareness follow.
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        np.subtract(x[j] * y[k] - x[k] * y[j], z[i], out=misfit[3 + i])
    np.abs(misfit, out=misfit)
    last_row = np.abs(T[3] - ((0.0,), (0.0,), (0.0,), (1.0,)))
    # NaN and infinity fail every comparison.
    if (
        not (misfit <= tolerances.ROTATION_EXACT).all()
        or last_row.any()
        or not np.isfinite(p).all()
    ):
        _clean(T, start)
    return T


def _clean(T: FloatArray, start: int) -> None:
    R, p = T[:3, :3].transpose(2, 0, 1), T[:3, 3]
    with np.errstate(invalid="ignore", over="ignore"):
        misfit = np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max(axis=(1, 2))
        last_row = np.abs(T[3] - ((0.0,), (0.0,), (0.0,), (1.0,))).max(axis=0)
        usable = (misfit <= tolerances.ROTATION_INPUT) & (np.linalg.det(R) > 0.0)
    usable &= (last_row <= tolerances.POSE_LAST_ROW) & np.isfinite(p).all(axis=0)
    for i in np.flatnonzero(~usable):
        T[:, :, i] = se3.validated(T[:, :, i], f"Pose {start + i}")
    U, _, Vt = np.linalg.svd(R)
    T[:3, :3] = (U @ Vt).transpose(1, 2, 0)
    T[3] = ((0.0,), (0.0,), (0.0,), (1.0,))


def _forward(chain: Chain, q: FloatArray) -> FloatArray:
    """T_S_tool (4, 4, C) at q (n, C): each factor exp(hat(S_i) q_i) = I + sin X + (1 - cos) X^2."""
    T: FloatArray = np.empty((4, 4, q.shape[1]))
    T[:] = chain.M[:, :, None]
    for i in range(chain.n)[::-1]:
        flat = T.reshape(4, -1)
        turned = (chain.generators[i] @ flat).reshape(T.shape)
        twice = (chain.generators_squared[i] @ flat).reshape(T.shape)
        turned *= np.sin(q[i])
        twice *= 2.0 * np.sin(0.5 * q[i]) ** 2
        T += turned
        T += twice
    return T


def _angle(Ta: FloatArray, Tb: FloatArray) -> FloatArray:
    """Angle [rad] between the rotations of two (4, 4, C), accurate at 0 and pi, as `so3.angle`."""
    Ra, Rb = Ta[:3, :3], Tb[:3, :3]

    def entry(i: int, j: int) -> FloatArray:
        product: FloatArray = Ra[0, i] * Rb[0, j] + Ra[1, i] * Rb[1, j] + Ra[2, i] * Rb[2, j]
        return product

    x, y, z = (entry(i, j) - entry(j, i) for i, j in ((2, 1), (0, 2), (1, 0)))
    trace = entry(0, 0) + entry(1, 1) + entry(2, 2)
    return np.asarray(np.atan2(np.sqrt(x * x + y * y + z * z), trace - 1.0))


def _distance(u: FloatArray, v: FloatArray, near: float, far: float) -> FloatArray:
    return np.asarray(np.minimum(np.maximum(np.sqrt(u * u + v * v), near), far))


_ARRAYS: Final = Functions(np.atan2, np.sqrt, np.sin, np.cos, _distance)


def _solve(chain: Chain, solver: Solver, T: FloatArray) -> FloatArray:
    """q (4, 5, C) of the poses `T` (4, 4, C)."""
    arm = solver.arm
    rows = T
    if not arm.is_canonical:
        # T_C_S T T_tool_K, the last product row by row.
        rows = arm.T_tool_K.T @ (arm.T_C_S @ T.reshape(4, -1)).reshape(T.shape)
    x, y = rows[:2, 3]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        rho = np.sqrt(x * x + y * y)
        r = np.sqrt((rho - arm.d) * (rho + arm.d)) if arm.d else rho
        # Not "<": what overflowed or lies inside the cylinder of radius d goes there too.
        beside = ~((r >= tolerances.NEAR_AXIS_1 * arm.reach) & np.isfinite(rho))
        alpha = _canonical(arm, rows, rho, r)
    q = _joints(chain, arm, alpha)
    for i in np.flatnonzero(beside):
        q[:, :, i] = solver.solve(T[:, :, i].tolist())
    return q


def _canonical(arm: FiveAxisArm, rows: FloatArray, rho: FloatArray, r: FloatArray) -> FloatArray:
    """alpha (4, 5, C), not yet in its turn, with tool points well off axis 1."""
    orient, reach = closed_form(arm, _ARRAYS)
    x, y, z = rows[:3, 3]
    alpha = np.empty((4, 5, len(x)))
    if arm.d:
        square = 1.0 / (rho * rho)
        planes = [((x * u + y * arm.d) * square, (y * u - x * arm.d) * square, u) for u in (r, -r)]
        facings = [(np.atan2(s, c), u, *orient(c, s, rows)[:4]) for c, s, u in planes]
    else:
        phi, five, lu, lv, lu2, lv2 = orient(x / rho, y / rho, rows)
        one = np.atan2(y, x)
        # The plane is the same, seen from behind.
        facings = [
            (one, rho, phi, five, lu, lv),
            (_behind(one), -rho, np.pi + 2.0 * arm.tilt - phi, _behind(five), lu2, lv2),
        ]
    for shoulder, (one, u, phi, five, lu, lv) in enumerate(facings):
        up, down, bend = reach(u - arm.a - lu, -z - lv)
        for elbow, (two, three) in enumerate(((up, bend), (down, -bend))):
            branch = alpha[2 * shoulder + elbow]
            branch[0], branch[1], branch[2], branch[4] = one, two, three, five
            np.subtract(phi, two + three, out=branch[3])
    return alpha


def _behind(theta: FloatArray) -> FloatArray:
    """Half a turn on, in [-pi, pi] as `theta` is."""
    return theta - np.copysign(np.pi, theta)


def _joints(chain: Chain, arm: FiveAxisArm, alpha: FloatArray) -> FloatArray:
    """q (4, 5, C), each angle in the turn inside its limits if there is one, else in [-pi, pi]."""
    for i, (sign, shift) in enumerate(zip(arm.signs, arm.shifts, strict=True)):
        angle = alpha[:, i]
        if shift:
            angle -= shift
        if sign < 0.0:
            np.negative(angle, out=angle)
        if shift or i in (1, 3):
            turns = angle * (0.5 / np.pi)
            np.rint(turns, out=turns)
            turns *= 2.0 * np.pi
            angle -= turns
    slack = tolerances.LIMIT_SLACK
    for i, (lower, upper) in enumerate(zip(chain.lower - slack, chain.upper + slack, strict=True)):
        if max(-lower, upper) <= np.pi + slack:
            continue
        angle = alpha[:, i]
        outside = (angle < lower) | (angle > upper)
        for turn in (-2.0 * np.pi, 2.0 * np.pi):
            other = angle + turn
            np.copyto(angle, other, where=outside & (other >= lower) & (other <= upper))
    return alpha


def _inside(chain: Chain, q: FloatArray) -> BoolArray:
    """(4, C) whether the angles q (4, 5, C) are inside the limits."""
    slack = tolerances.LIMIT_SLACK
    lower, upper = chain.lower - slack, chain.upper + slack
    inside = np.ones((4, q.shape[2]), dtype=np.bool_)
    for i in range(5):
        inside &= q[:, i] >= lower[i]
        inside &= q[:, i] <= upper[i]
    return inside
