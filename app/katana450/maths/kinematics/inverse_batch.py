"""Inverse kinematics of many poses at once, in chunks that fit the cache.

It runs the formulas of maths/kinematics/solver.py on arrays. The few poses with the
tool point near axis 1, which need case distinctions, use the scalar `Solver`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import CHUNK, chunks, number_array
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.solver import Functions, Solver, closed_form
from katana450.maths.kinematics.turns import in_limits_turns

_LAST_ROW: Final = np.array([[0.0], [0.0], [0.0], [1.0]])

_SQUARES_HOLD: Final = 1e-150
"""Minimum length whose square keeps its digits."""


def inverse_batch(chain: Chain, T: npt.ArrayLike) -> FloatArray:
    """Return the joint angles (N, 4, 5) [rad] of the four solutions of each pose, as `inverse`.

    `T` (N, 4, 4) = T_S_tool [m]; the branches are in the order of BRANCHES.

    Raises InputError for the first invalid pose, RobotDescriptionError for an arm outside the
    family.
    """
    form = _arm(chain)
    T = number_array(T, (4, 4), "The poses")
    q = np.empty((len(T), 4, 5))
    # One block of memory: malloc reuses a block of the same size, so no page is cleared again.
    work = np.empty(36 * min(len(T), CHUNK))
    # Values that are not finite are rejected, or left to the scalar solver.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for rows in chunks(len(T)):
            canonical, angles = _arrays(work, rows.stop - rows.start)
            np.copyto(canonical, T[rows].transpose(1, 2, 0))
            _validate(canonical, rows.start, angles.reshape(20, -1))
            _solve(form, canonical, angles, q[rows])
    return q


def validated_poses(T: npt.ArrayLike) -> FloatArray:
    """Return clean copies of poses `T` (N, 4, 4), each as `se3.validated`.

    Raises InputError for the first invalid pose.
    """
    poses = number_array(T, (4, 4), "The poses").copy()
    with np.errstate(over="ignore", invalid="ignore"):
        for rows in chunks(len(poses)):
            columns = poses[rows].transpose(1, 2, 0)
            _validate(columns, rows.start, np.empty((15, columns.shape[2])))
    return poses


def _arrays(work: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return views for poses (4, 4, count) and angles (2, 2, 5, count) in `work`."""
    canonical, angles = work[: 16 * count], work[16 * count : 36 * count]
    return canonical.reshape(4, 4, count), angles.reshape(2, 2, 5, count)


def _validate(T: FloatArray, start: int, work: FloatArray) -> None:
    """Make the poses `T` (4, 4, C) clean in place, or raise InputError as for single poses.

    `start` is the number of the first pose. `work` (15, C) or larger is scratch memory.
    """
    x, y, z = T[:3, 0], T[:3, 1], T[:3, 2]
    misfit, products = work[:6], work[12:15]
    squares = work[6:12].reshape(3, 2, -1)
    np.multiply(T[:3, :2], T[:3, :2], out=squares)
    np.add(squares[0] + squares[1], squares[2], out=misfit[:2])
    misfit[:2] -= 1.0
    np.multiply(x, y, out=products)
    np.add(products[0] + products[1], products[2], out=misfit[2])
    # The third axis is right-handed: its unit length and orthogonality follow.
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        np.subtract(x[j] * y[k] - x[k] * y[j], z[i], out=misfit[3 + i])
    # NaN and infinity fail every comparison.
    if (
        not np.abs(misfit, out=misfit).max() <= tolerances.ROTATION_EXACT
        or (T[3] != _LAST_ROW).any()
        or not np.abs(T[:3, 3], out=products).max() <= tolerances.FARTHEST
    ):
        _clean(T, start)


def _clean(T: FloatArray, start: int) -> None:
    """Replace each rotation in `T` by the nearest one, or raise InputError for an invalid pose."""
    R, p = T[:3, :3].transpose(2, 0, 1), T[:3, 3]
    misfit = np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max(axis=(1, 2))
    last_row = np.abs(T[3] - _LAST_ROW).max(axis=0)
    usable = (misfit <= tolerances.ROTATION_INPUT) & (np.linalg.det(R) > 0.0)
    usable &= last_row <= tolerances.POSE_LAST_ROW
    usable &= (np.abs(p) <= tolerances.FARTHEST).all(axis=0)
    for i in np.flatnonzero(~usable):
        T[:, :, i] = se3.validated(T[:, :, i], f"Pose {start + i}")
    U, _, Vt = np.linalg.svd(R)
    T[:3, :3] = (U @ Vt).transpose(1, 2, 0)
    T[3] = _LAST_ROW


def _root(x: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(x, 0.0)))


def _direction(y: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    angle, length = np.atan2(y, x), np.sqrt(x * x + y * y)
    # Computing sine and cosine would dominate the time of this function.
    cosine, sine = x / length, y / length
    if not np.minimum.reduce(length) > _SQUARES_HOLD:
        short = ~(length > _SQUARES_HOLD)
        cosine[short], sine[short] = np.cos(angle[short]), np.sin(angle[short])
    return angle, cosine, sine


_ARRAYS: Final = Functions(np.atan2, np.sqrt, _root, _direction)


class _Arm(NamedTuple):
    """Values that are computed once per chain.

    Attributes:
        chain: the chain.
        solver: the scalar solver.
        posture: the closed form on arrays.
        is_turned: whether an angle differs from that of the canonical arm, or a limit exceeds half
            a turn.
    """

    chain: Chain
    solver: Solver
    posture: Callable[..., Any]
    is_turned: bool


@lru_cache(maxsize=64)
def _arm(chain: Chain) -> _Arm:
    solver = Solver.of(chain)
    arm = solver.arm
    is_canonical = set(arm.signs) == {1.0} and not any(arm.shifts)
    is_turned = not is_canonical or max(-chain.lower.min(), chain.upper.max()) > np.pi
    return _Arm(chain, solver, closed_form(arm, _ARRAYS), bool(is_turned))


def _solve(form: _Arm, T: FloatArray, angles: FloatArray, q: FloatArray) -> None:
    """Fill `q` (C, 4, 5) for the poses `T` (4, 4, C).

    `angles` (2, 2, 5, C) is scratch memory.
    """
    solver, arm = form.solver, form.solver.arm
    rows = T
    if not arm.is_canonical:
        # T_C_S T T_tool_K, the last product row by row.
        rows = arm.T_tool_K.T @ (arm.T_C_S @ T.reshape(4, -1)).reshape(T.shape)
    x, y = rows[0, 3], rows[1, 3]
    rho = np.sqrt(x * x + y * y)
    r = np.sqrt((rho - arm.d) * (rho + arm.d)) if arm.d else rho
    # Both comparisons are false for an overflow and inside the cylinder of radius d.
    near_axis = ~((r >= tolerances.NEAR_AXIS_1 * arm.reach) & (r < np.inf))
    _canonical(form, rows, rho, r, angles)
    q[...] = angles.reshape(4, 5, -1).transpose(2, 0, 1)
    if form.is_turned:
        q[...] = in_limits_turns(form.chain, (q - arm.shifts) * arm.signs)
    for i in near_axis.nonzero()[0]:
        q[i] = solver.solve(T[:, :, i].tolist())


def _canonical(
    form: _Arm, rows: FloatArray, rho: FloatArray, r: FloatArray, alpha: FloatArray
) -> None:
    """Fill `alpha` (2, 2, 5, C) (shoulder, elbow, joint) in [-pi, pi], for poses off axis 1."""
    posture, arm = form.posture, form.solver.arm
    x, y = rows[0, 3], rows[1, 3]

    def fill_shoulder(side: FloatArray, c: FloatArray, s: FloatArray, u: FloatArray) -> None:
        """Fill the angles of one shoulder `side` (2, 5, C), except alpha1."""
        up, down = side
        phi, up[1], down[1], up[2], side[:, 4] = posture(c, s, u, rows)
        np.negative(up[2], out=down[2])
        np.subtract(phi - side[:, 1], side[:, 2], out=side[:, 3])
        _wrap(side[:, 1::2])

    front, back = alpha
    if arm.d:
        square = 1.0 / (rho * rho)
        for side, u in ((front, r), (back, -r)):
            c, s = (x * u + y * arm.d) * square, (y * u - x * arm.d) * square
            side[:, 0] = np.atan2(s, c)
            fill_shoulder(side, c, s, u)
        return
    c, s, one = x / rho, y / rho, np.atan2(y, x)
    front[:, 0], back[:, 0] = one, _behind(one)
    fill_shoulder(front, c, s, rho)
    if arm.is_mirrored:
        np.negative(_behind(front[::-1, 1]), out=back[:, 1])
        np.negative(front[::-1, 2:4], out=back[:, 2:4])
        back[:, 4] = _behind(front[0, 4])
    else:
        fill_shoulder(back, -c, -s, -rho)


def _behind(theta: FloatArray) -> FloatArray:
    """Return `theta` plus or minus half a turn, in [-pi, pi] if `theta` is."""
    return theta - np.copysign(np.pi, theta)


def _wrap(theta: FloatArray) -> None:
    """Wrap `theta` to [-pi, pi] in place."""
    turns = theta * (0.5 / np.pi)
    np.rint(turns, out=turns)
    turns *= 2.0 * np.pi
    theta -= turns
