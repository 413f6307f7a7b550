"""The fraction of tool orientations that a 5-axis arm can have at a point.

At a point off axis 1 a 5-axis arm is free in two angles of the tool: its pitch, by which the roll
axis leans in the arm's plane through the point, and its roll about that axis. Pitch and roll are
each tried in equal steps over a full turn. The fraction counts the pairs for which a posture holds
the tool at the point with every joint inside its limits, and elbow, wrist and tool point not below
the table. Contacts of bodies are not checked: links may cross each other or the table's edge.

Everything is computed on the canonical arm (maths/kinematics/arm.py). If its plane passes beside
axis 1, there are two planes through a point, one for each shoulder posture; the same pitch and roll
in both count once. A tool point beside the roll axis moves as the tool rolls, so each roll is
computed separately.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array
from katana450.maths.kinematics.arm import FiveAxisArm, arm_of
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse_batch import inverse_batch

IntArray = npt.NDArray[np.int64]
"""An array of 64-bit integers."""

MIN_VOXEL = 1e-3
"""[m] Minimum edge of a voxel: the accuracy of the arm's joints at the tool."""


@dataclass(frozen=True)
class VoxelGrid:
    """Voxels of edge ``size`` [m] whose corners lie on multiples of it in the base frame.

    Flat indices run over z first.

    Attributes:
        size: edge of a voxel [m].
        first: index of the lowest voxel in x, y, z; voxel i reaches from i * size to (i + 1) *
            size.
        shape: number of voxels in x, y, z.
    """

    size: float
    first: tuple[int, int, int]
    shape: tuple[int, int, int]

    @staticmethod
    def around(center: npt.ArrayLike, reach: float, size: float, table: float) -> VoxelGrid:
        """Return the voxels of the ball of ``reach`` [m] about ``center`` (3,), above ``table``.

        ``table`` is a height z [m]; voxels with their centre below it are left out. Raises
        InputError for an invalid ``size``, and for a table above the reach.
        """
        middle = finite_array(center, (3,), "The centre of the grid")
        if not MIN_VOXEL <= size <= reach:
            raise InputError(
                f"The edge of a voxel is {1e3 * size:g} mm; it must be from "
                f"{1e3 * MIN_VOXEL:g} to {1e3 * reach:.0f} mm."
            )
        top = float(middle[2]) + reach
        if not -math.inf < table < top:
            raise InputError(
                f"A table at {1e3 * table:g} mm leaves no reachable space above it. The tool "
                f"reaches up to {1e3 * top:.0f} mm."
            )
        low = np.floor((middle - reach) / size).astype(int).tolist()
        high = np.ceil((middle + reach) / size).astype(int).tolist()
        low[2] = max(low[2], math.ceil(table / size - 0.5))
        high[2] = max(high[2], low[2] + 1)
        (x, y, z), (nx, ny, nz) = low, (b - a for a, b in zip(low, high, strict=True))
        return VoxelGrid(size, (x, y, z), (nx, ny, nz))

    def __len__(self) -> int:
        return math.prod(self.shape)

    def chunks(self, length: int) -> list[range]:
        """Return all flat indices in their order, in ranges of ``length``."""
        return [range(len(self))[at : at + length] for at in range(0, len(self), length)]

    def centers(self, indices: npt.ArrayLike) -> FloatArray:
        """Return the centres (N, 3) of the voxels ``indices`` (N,), in the base frame [m]."""
        cells = np.stack(np.unravel_index(np.asarray(indices, dtype=np.int64), self.shape), axis=-1)
        centers: FloatArray = (cells + np.array(self.first) + 0.5) * self.size
        return centers


BoolArray = npt.NDArray[np.bool]

MAX_STEPS = 720
"""Maximum number of steps of a turn: half a degree, finer than the straightness of the links."""


@dataclass(frozen=True, eq=False)
class Reachability:
    """The test of orientations at points.

    Attributes:
        chain: the arm with its tool, in {S}.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
        table: height z of the table in the base frame [m].
        pitches: number of pitches in a turn.
        rolls: number of rolls in a turn.

    Raises InputError for a number of steps outside 1 to MAX_STEPS, and RobotDescriptionError for an
    arm whose axis 1 is not upright.
    """

    chain: Chain
    T_base_shoulder: FloatArray
    table: float
    pitches: int
    rolls: int

    def __post_init__(self) -> None:
        check_steps(self.pitches, self.rolls)
        lean = float(np.linalg.norm(self.T_base_canonical[:3, 2] - (0.0, 0.0, 1.0)))
        if lean > tolerances.MAPPED_ARM:
            raise RobotDescriptionError(
                "The workspace of this arm cannot be mapped: axis 1 must be upright, and it leans "
                f"by {math.degrees(lean):.3g} deg."
            )

    @property
    def _arm(self) -> FiveAxisArm:
        return arm_of(self.chain)

    @property
    def T_base_canonical(self) -> FloatArray:
        """The pose (4, 4) of the canonical arm's frame {C} in the base frame [m]."""
        return self.T_base_shoulder @ se3.inverse(self._arm.T_C_S)

    @property
    def orientations(self) -> int:
        """The number of pairs of pitch and roll that are tried at a point."""
        return self.pitches * self.rolls

    @property
    def poses_at_once(self) -> int:
        """The number of poses of each point that are solved at once."""
        return self.pitches

    @property
    def reach(self) -> float:
        """The maximum distance of the tool from the origin of {C} [m]."""
        arm = self._arm
        return math.hypot(abs(arm.a) + arm.l1 + arm.l2 + arm.l3, arm.d) + arm.off_axis

    def grid(self, voxel: float) -> VoxelGrid:
        """Return the voxels of edge ``voxel`` [m] that may have a reachable point."""
        return VoxelGrid.around(self.T_base_canonical[:3, 3], self.reach, voxel, self.table)

    def count(self, points: FloatArray) -> IntArray:
        """Return the number of possible orientations (N,) at ``points`` (N, 3), base frame [m]."""
        T_base_C = self.T_base_canonical
        p = (points - T_base_C[:3, 3]) @ T_base_C[:3, :3]
        within = (points[:, 2] >= self.table) & ((p * p).sum(axis=1) <= self.reach**2)
        near = np.flatnonzero(within)
        counts = np.zeros(len(points), dtype=np.int64)
        possible = np.zeros((len(near) * self.pitches, self.rolls), dtype=np.bool)
        beside = self._arm.off_axis > 0.0
        for roll in range(self.rolls if beside else 1):
            # The rolls that a posture can take: all of them, or only the one that it is for.
            rolls = slice(roll, roll + 1) if beside else slice(None)
            for poses in self.tool_poses(p[near], roll):
                T = poses.reshape(-1, 4, 4)
                q = inverse_batch(self.chain, T)
                pose, branch = np.nonzero(self._free(q))
                # Postures for a pose out of reach are only near it.
                exact = _same(forward_batch(self.chain, q[pose, branch]), T[pose])
                pose, branch = pose[exact], branch[exact]
                rollable = self._rollable(q[pose, branch, 4])
                if beside:
                    rollable = rollable[:, :1]
                for number in range(q.shape[1]):
                    here = branch == number
                    possible[pose[here], rolls] |= rollable[here]
        counts[near] = possible.reshape(len(near), self.orientations).sum(axis=1)
        return counts

    def tool_poses(self, p: FloatArray, roll: int = 0) -> Iterator[FloatArray]:
        """Yield T_S_tool (N, pitches, 4, 4) at ``p`` (N, 3) of {C} [m], at a step of the roll.

        Pitch 0 is outward and positive pitch downwards. The first item is for the arm facing the
        points. If that gives another plane, a second item is for the arm with its back to them.
        """
        arm = self._arm
        phi = np.linspace(0.0, math.tau, self.pitches, endpoint=False)
        angle = roll * math.tau / self.rolls
        rho = np.hypot(p[:, 0], p[:, 1])[:, None]
        # On axis 1 the bearing is arbitrary.
        bearing = np.where(rho == 0.0, 0.0, np.arctan2(p[:, 1], p[:, 0])[:, None])
        # Offset from {K} to the tool point: (1 or pitches,) outward, sideways and up.
        pitches = phi.tolist() if arm.off_axis else [0.0]
        out, side, up = np.transpose([arm.beside(pitch, angle) for pitch in pitches])
        T_S_C, roll_K = se3.inverse(arm.T_C_S), np.eye(4)
        roll_K[:3, :3] = so3.rotation_x(angle)
        for turn in (1.0, -1.0) if arm.d or arm.off_axis else (1.0,):
            lateral = arm.d + turn * side
            outward = turn * np.sqrt(np.maximum(rho**2 - lateral**2, 0.0))
            alpha1 = bearing - np.arctan2(lateral, outward)
            c, s = turn * np.cos(alpha1), turn * np.sin(alpha1)
            beside = np.stack((c * out - s * side, s * out + c * side, up + 0.0 * c), axis=-1)
            T_C_K = _roll_frames(p[:, None, :] - beside, c, s, phi)
            yield T_S_C @ T_C_K @ roll_K @ arm.T_K_tool

    def _rollable(self, theta5: FloatArray) -> BoolArray:
        """Return (N, rolls) whether axis 5 can add each roll to its angle ``theta5`` (N,) [rad]."""
        lower, upper = self.chain.lower[4], self.chain.upper[4]
        slack = tolerances.LIMIT_SLACK
        rolls = np.arange(self.rolls) * (math.tau / self.rolls) * self._arm.signs[4]
        beyond_lower = np.mod(theta5[:, None] + rolls - lower + slack, math.tau)
        fits: BoolArray = beyond_lower <= upper - lower + 2.0 * slack
        return fits

    def _free(self, q: FloatArray) -> BoolArray:
        """Return (N, B) whether axes 1 to 4 are within limits, and the arm above the table."""
        slack = tolerances.LIMIT_SLACK
        lower, upper = self.chain.lower[:4] - slack, self.chain.upper[:4] + slack
        inside = ((q[..., :4] >= lower) & (q[..., :4] <= upper)).all(axis=-1)
        return np.asarray(inside & self.clear(q))

    def clear(self, q: FloatArray) -> BoolArray:
        """Return (...) whether elbow and wrist are not below the table at ``q`` (..., 5) [rad]."""
        arm = self._arm
        alpha = arm.canonical(q)
        elbow = self.T_base_canonical[2, 3] - arm.l1 * np.sin(alpha[..., 1])
        wrist = elbow - arm.l2 * np.sin(alpha[..., 1] + alpha[..., 2])
        return np.asarray(np.minimum(elbow, wrist) >= self.table)


def check_steps(pitches: int, rolls: int) -> None:
    """Raise InputError for a number of steps outside 1 to MAX_STEPS."""
    for name, steps in (("pitches", pitches), ("rolls", rolls)):
        if not 1 <= steps <= MAX_STEPS:
            raise InputError(f"The number of {name} is {steps}; it must be from 1 to {MAX_STEPS}.")


def _roll_frames(p: FloatArray, c: FloatArray, s: FloatArray, phi: FloatArray) -> FloatArray:
    """Return T_C_K (N, pitches, 4, 4) at ``p`` (N, 1 or pitches, 3), pitched by ``phi``, unrolled.

    ``c`` and ``s`` (N, 1 or pitches) are cosine and sine of the outward bearing. Seen from the back
    of the arm's plane, this is opposite to its own u.
    """
    cp, sp = np.cos(phi), np.sin(phi)
    T = np.zeros((len(p), len(phi), 4, 4))
    T[..., 0, 0], T[..., 0, 1], T[..., 0, 2] = c * cp, -s, c * sp
    T[..., 1, 0], T[..., 1, 1], T[..., 1, 2] = s * cp, c, s * sp
    T[..., 2, 0], T[..., 2, 2] = -sp, cp
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def _same(Ta: FloatArray, Tb: FloatArray) -> BoolArray:
    """Return (N,) whether poses (N, 4, 4) agree, entry by entry."""
    gap = np.abs(Ta - Tb)
    in_place = gap[:, :3, 3].max(axis=1) <= tolerances.SAME_POSITION
    return np.asarray(in_place & (gap[:, :3, :3].max(axis=(1, 2)) <= tolerances.SAME_ROTATION))
