"""The nearest pose of any member of the family by slow, approximate searches."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.batch import errors_of, forward_batch
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse_batch import inverse_batch
from katana450.maths.kinematics.tool import ToolTarget

Mask = npt.NDArray[np.bool_]

STARTS, SAMPLES, ROUNDS = 12, 40, 120


def minimum(
    objective: Callable[[FloatArray], FloatArray],
    lower: FloatArray,
    upper: FloatArray,
    rng: np.random.Generator,
) -> float:
    """Return the minimum of ``objective`` that a shrinking random search within the limits finds.

    ``objective`` has a value for each row (k, 5) of angles [rad], which is infinite for one that is
    not allowed. It may also change the row.
    """
    q = rng.uniform(lower, upper, size=(20_000, 5))
    values = objective(q)
    best = np.argpartition(values, STARTS)[:STARTS]
    q, least, width = q[best], values[best], np.full(STARTS, 0.2)
    rows = np.arange(STARTS)
    for _ in range(ROUNDS):
        step = rng.normal(size=(STARTS, SAMPLES, 5)) * width[:, None, None]
        # Moving few joints at a time keeps the others at their limits.
        step *= rng.random(step.shape) < 0.6
        # With axis 4 at a limit the two axes before it must move against each other.
        step[:, ::3, 2] = -step[:, ::3, 1]
        moved = np.clip(q[:, None] + step, lower, upper).reshape(-1, 5)
        values = objective(moved).reshape(STARTS, SAMPLES)
        k = values.argmin(axis=1)
        better = values[rows, k] < least
        q[better] = moved.reshape(STARTS, SAMPLES, 5)[rows, k][better]
        least = np.where(better, values[rows, k], least)
        width *= np.where(better, 1.3, 0.75)
    return float(least.min())


def on_branch(chain: Chain, q: FloatArray, points: FloatArray, branch: Branch | None) -> Mask:
    """Return which joint vectors (k, 5) [rad] are on `branch`; None stands for all.

    ``points`` are their tool points (k, 3) [m] in {S}.
    """
    if branch is None:
        return np.ones(len(q), dtype=np.bool_)
    arm = arm_of(chain)
    alpha = arm.canonical(q)
    x, y, _ = arm.T_C_S[:3, :3] @ points.T + arm.T_C_S[:3, 3:]
    r = x * np.cos(alpha[:, 0]) + y * np.sin(alpha[:, 0])
    shoulder = r >= 0.0 if branch.shoulder == "front" else r <= 0.0
    return np.asarray(shoulder & ((np.sin(alpha[:, 2]) >= 0.0) == (branch.elbow == "up")))


def nearest_point(
    chain: Chain, target: FloatArray, branch: Branch | None, rng: np.random.Generator
) -> float:
    """Return the minimum distance [m] of the tool point inside the limits from `target` (3,)."""

    def distances(q: FloatArray) -> FloatArray:
        points = forward_batch(chain, q)[:, :3, 3]
        away = np.linalg.norm(points - target, axis=1)
        return np.where(on_branch(chain, q, points, branch), away, np.inf)

    return minimum(distances, chain.lower, chain.upper, rng)


def planes(chain: Chain, point: FloatArray, theta1: float) -> list[float]:
    """Return the angles [rad] of axis 1 whose planes hold `point`, or `theta1` if all do."""
    return [ToolTarget(point).facing(chain, branch, theta1) for branch in BRANCHES[::2]]


def postures_at(
    chain: Chain,
    point: FloatArray,
    theta1s: Sequence[float] | FloatArray,
    pitches: int,
    branches: Sequence[Branch] = BRANCHES,
) -> FloatArray:
    """Return joint vectors (k, 5) [rad] with the tool point at `point` and the roll at 0.

    They are those on ``branches``, in planes at ``theta1s`` [rad], at a number of pitches, with
    axes 1 to 4 inside their limits.
    """
    arm = arm_of(chain)
    turns = arm.signs[0] * np.array(theta1s)
    alpha, pitch = np.meshgrid(turns, np.linspace(-np.pi, np.pi, pitches))
    c, s, cp, sp = np.cos(alpha), np.sin(alpha), np.cos(pitch), np.sin(pitch)
    zero = np.zeros_like(c)
    R = np.array([[c * cp, -s, c * sp], [s * cp, c, s * sp], [-sp, zero, cp]]).T.reshape(-1, 3, 3)
    poses = np.tile(np.eye(4), (len(R), 1, 1))
    poses[:, :3, :3] = arm.T_C_S[:3, :3].T @ R.transpose(0, 2, 1) @ arm.T_K_tool[:3, :3]
    poses[:, :3, 3] = point
    q = inverse_batch(chain, poses)
    position, rotation = errors_of(chain, q, poses)
    fits = ((q >= chain.lower) & (q <= chain.upper))[:, :, :4].all(axis=2)
    fits &= (position < 1e-9) & (rotation < 1e-9)
    return q[fits & [branch in branches for branch in BRANCHES]]


def least_rotation(chain: Chain, T: FloatArray, q: FloatArray) -> float:
    """Return the minimum angle [rad] to `T` of the postures `q` (k, 5) [rad] with any roll."""
    arm = arm_of(chain)
    level = np.array(q)
    level[:, 4] = arm.joints(np.zeros(5))[4]
    R = arm.T_C_S[:3, :3] @ forward_batch(chain, level)[:, :3, :3] @ arm.T_tool_K[:3, :3]
    M = R.transpose(0, 2, 1) @ arm.pose(T)[:3, :3]
    lower, upper = arm.canonical((chain.lower, chain.upper))[:, 4].tolist()
    roll = np.linspace(lower, upper, 500)
    # trace(Rx(roll)^T M)
    turning = np.outer(M[:, 1, 1] + M[:, 2, 2], np.cos(roll))
    turning += np.outer(M[:, 2, 1] - M[:, 1, 2], np.sin(roll))
    trace = float((M[:, 0, 0] + turning.max(axis=1)).max(initial=-1.0))
    return float(np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0)))
