"""How freely the tool can be turned at a point: the share of orientations inside the limits.

At a point off axis 1 a 5-axis arm is free to choose two angles of the tool: its pitch, by which the
tool's x axis leans in the vertical plane through axis 1 and the point, and its roll about that
axis. The share is that of pitch and roll, each taken all round in equal steps, at which some
posture holds the tool there with every joint inside its limits and elbow, wrist and tool point not
below the table. Bodies are not looked at: links may cross each other or the table's edge.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app import tolerances
from app.errors import InputError, RobotDescriptionError
from app.geometry import screws
from app.geometry.arrays import FloatArray
from app.kinematics.arm import arm_of
from app.kinematics.chain import Chain
from app.workspace import postures
from app.workspace.grid import IntArray, VoxelGrid

BoolArray = npt.NDArray[np.bool]

MOST_STEPS = 720
"""Half a degree, finer than the links of the arm are straight."""


@dataclass(frozen=True, eq=False)
class Reachability:
    """What is asked of every point.

    chain: the arm with its tool, in {S}. T_base_shoulder: (4, 4) where {S} stands. table: height z
    of the table in the base frame [m]. pitches, rolls: in how many steps a turn is cut. Raises
    InputError for another number of steps than 1 to MOST_STEPS, RobotDescriptionError for an arm
    whose tool does not roll in a plane through an upright axis 1.
    """

    chain: Chain
    T_base_shoulder: FloatArray
    table: float
    pitches: int
    rolls: int

    def __post_init__(self) -> None:
        for name, steps in (("pitches", self.pitches), ("rolls", self.rolls)):
            if not 1 <= steps <= MOST_STEPS:
                raise InputError(f"The number of {name} is {steps}; give 1 to {MOST_STEPS}.")
        _check_layout(self.chain, self.T_base_shoulder)

    @property
    def orientations(self) -> int:
        """How many pairs of pitch and roll are tried at a point."""
        return self.pitches * self.rolls

    @property
    def reach(self) -> float:
        """No point farther than this from the origin of {S} can be reached [m]."""
        stations = [*_axis_points(self.chain)[:4], self.chain.M[:3, 3]]
        return sum(math.dist(a, b) for a, b in itertools.pairwise(stations))

    def grid(self, voxel: float) -> VoxelGrid:
        """The voxels of edge `voxel` [m] that may hold a reachable point."""
        return VoxelGrid.around(self.T_base_shoulder[:3, 3], self.reach, voxel, self.table)

    def count(self, points: FloatArray) -> IntArray:
        """(N,) how many orientations can be had at each of `points` (N, 3), base frame [m]."""
        R, origin = self.T_base_shoulder[:3, :3], self.T_base_shoulder[:3, 3]
        p = (points - origin) @ R
        within = (points[:, 2] >= self.table) & ((p * p).sum(axis=1) <= self.reach**2)
        near = np.flatnonzero(within)
        counts = np.zeros(len(points), dtype=np.int64)
        T = tool_poses(p[near], self.pitches)
        T = T.reshape(-1, 4, 4)
        q = postures.at(self.chain, T)
        pose, branch = np.nonzero(self._free(T, q))
        # The postures for a pose out of reach only come near it.
        exact = _same(postures.poses(self.chain, q[pose, branch]), T[pose])
        pose, branch = pose[exact], branch[exact]
        rollable = self._rollable(q[pose, branch, 4])
        possible = np.zeros((len(T), self.rolls), dtype=np.bool)
        for number in range(q.shape[1]):
            here = branch == number
            possible[pose[here]] |= rollable[here]
        counts[near] = possible.reshape(len(near), self.orientations).sum(axis=1)
        return counts

    def _rollable(self, theta5: FloatArray) -> BoolArray:
        """(N, rolls) whether axis 5 can add each roll to its angle `theta5` (N,) [rad].

        Axis 5 turns the tool about its own x axis, so every roll follows from one.
        """
        lower, upper = self.chain.lower[4], self.chain.upper[4]
        slack = tolerances.LIMIT_SLACK
        rolls = np.arange(self.rolls) * (math.tau / self.rolls)
        beyond_lower = np.mod(theta5[:, None] + rolls - lower + slack, math.tau)
        fits: BoolArray = beyond_lower <= upper - lower + 2.0 * slack
        return fits

    def _free(self, T: FloatArray, q: FloatArray) -> BoolArray:
        """(N, 4) whether axes 1 to 4 are inside their limits and the arm is clear of the table."""
        slack = tolerances.LIMIT_SLACK
        lower, upper = self.chain.lower[:4] - slack, self.chain.upper[:4] + slack
        inside = ((q[..., :4] >= lower) & (q[..., :4] <= upper)).all(axis=-1)
        return np.asarray(inside & self.clear(T, q))

    def clear(self, T: FloatArray, q: FloatArray) -> BoolArray:
        """(N, B) whether elbow and wrist are not below the table.

        T: (N, 4, 4) poses T_S_tool [m]; q: (N, B, 5) postures for each of them [rad].
        """
        chain = self.chain
        shoulder, elbow, wrist = _axis_points(chain)[1:4]
        table = self.table - float(self.T_base_shoulder[2, 3])
        in_tool = chain.M[:3, :3].T @ (wrist - chain.M[:3, 3])
        wrist_height = T[:, 2, :3] @ in_tool + T[:, 2, 3]
        outward = elbow - shoulder
        upward = np.cross(chain.S[:3, 1], outward)
        theta2 = q[..., 1]
        elbow_height = shoulder[2] + np.cos(theta2) * outward[2] + np.sin(theta2) * upward[2]
        return np.asarray((elbow_height >= table) & (wrist_height >= table)[:, None])

    def in_base(self, p: FloatArray) -> FloatArray:
        """(N, 3) points `p` (N, 3) of {S} in the base frame [m]."""
        return p @ self.T_base_shoulder[:3, :3].T + self.T_base_shoulder[:3, 3]


def tool_poses(p: FloatArray, pitches: int) -> FloatArray:
    """(N, pitches, 4, 4) poses T_S_tool at the points `p` (N, 3) of {S} [m], unrolled.

    The tool's x axis lies in the upright plane through axis 1 and the point; pitch 0 is outward,
    and positive pitch downwards.
    """
    radius = np.hypot(p[:, 0], p[:, 1])
    on_axis = radius == 0.0
    c = np.where(on_axis, 1.0, p[:, 0]) / np.where(on_axis, 1.0, radius)
    s = np.where(on_axis, 0.0, p[:, 1]) / np.where(on_axis, 1.0, radius)
    c, s = c[:, None], s[:, None]
    phi = np.arange(pitches) * (math.tau / pitches)
    cp, sp = np.cos(phi), np.sin(phi)
    T = np.zeros((len(p), pitches, 4, 4))
    T[..., 0, 0], T[..., 0, 1], T[..., 0, 2] = c * cp, -s, c * sp
    T[..., 1, 0], T[..., 1, 1], T[..., 1, 2] = s * cp, c, s * sp
    T[..., 2, 0], T[..., 2, 2] = -sp, cp
    T[..., :3, 3] = p[:, None, :]
    T[..., 3, 3] = 1.0
    return T


def _same(Ta: FloatArray, Tb: FloatArray) -> BoolArray:
    """(N,) whether poses (N, 4, 4) agree, entry by entry."""
    gap = np.abs(Ta - Tb)
    in_place = gap[:, :3, 3].max(axis=1) <= tolerances.SAME_POSITION
    return np.asarray(in_place & (gap[:, :3, :3].max(axis=(1, 2)) <= tolerances.SAME_ROTATION))


def _axis_points(chain: Chain) -> FloatArray:
    """(5, 3) a point on each axis at q = 0 in {S} [m]: where the arm's plane cuts axes 2 to 4."""
    return np.array([screws.point_on(S) for S in chain.S.T])


def _check_layout(chain: Chain, T_base_shoulder: FloatArray) -> None:
    arm_of(chain)
    points, directions = _axis_points(chain), chain.S[:3].T
    normal, x = directions[1], chain.M[:3, 0]
    upright = np.array([0.0, 0.0, 1.0])
    for what, off in (
        ("the base must stand upright", T_base_shoulder[2, :3] - upright),
        ("axis 1 must be upright in the origin of {S}", [*(directions[0] - upright), *points[0]]),
        ("axis 2 must be level", normal @ upright),
        ("the tool must roll about its x axis", directions[4] - x),
        ("the tool point must lie on axis 5", np.cross(x, chain.M[:3, 3] - points[4])),
        ("axis 4 must cross axis 5", np.cross(x, points[3] - points[4])),
        ("axis 5 must lie in a plane through axis 1", (normal @ x, normal @ points[4])),
    ):
        size = float(np.linalg.norm(off))
        if size > tolerances.MAPPED_ARM:
            raise RobotDescriptionError(
                f"The workspace of this arm cannot be mapped: {what}, which is off by {size:.3g} "
                "(m or rad)."
            )
