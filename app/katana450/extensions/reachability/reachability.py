"""The reachability map: the points that the tool reaches, and its orientations at each.

The orientations that are tried depend on what the arm can choose:

    six and seven axes  directions of the z axis of the tool, spread evenly over the sphere, with
    in closed form      turns about each; orientations in the base frame.
    five-axis family    pitches and rolls in equal steps over a full turn. The roll axis leans by
                        the pitch in the plane of the arm through the point. Where this plane passes
                        beside axis 1, there are two, one for each shoulder posture; the same pitch
                        and roll in both count once.
    all others          any orientation counts as one: the tool points of many random postures are
                        counted by voxels.

An orientation counts if a posture takes it with every joint inside its limits, and no axis from the
third on is below the table where its link begins. Contacts of bodies are not checked. Of seven axes
some arm angles are tried, and random postures can leave out a voxel; so both can miss an
orientation, but count none too many.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.links import DHLinks, links_of
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import BoolArray, FloatArray, IntArray, finite_array
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.batch import errors_of, forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import Kinematics

ARM_ANGLES: Final = 16
"""Number of arm angles of seven axes that are tried for a pose."""


@dataclass(frozen=True, eq=False)
class PoseSolver:
    """The test of poses of one arm.

    Attributes:
        solver: its kinematics.
        accepts: returns (N,) whether postures (N, n) [rad] may be taken.
    """

    solver: Kinematics
    accepts: Callable[[FloatArray], BoolArray]

    @property
    def chain(self) -> Chain:
        """The chain."""
        return self.solver.chain

    def taken(self, T: FloatArray) -> BoolArray:
        """Return (N,) whether a posture inside the limits takes the pose, for `T` (N, 4, 4)."""
        is_taken = np.zeros(len(T), dtype=np.bool)
        for arm_angle in self._arm_angles:
            left = np.flatnonzero(~is_taken)
            q = self.solver.at_arm_angles(T[left], np.full(len(left), arm_angle))
            is_taken[left[self.exact(q, T[left])[0]]] = True
        return is_taken

    @property
    def _arm_angles(self) -> FloatArray:
        """The arm angles [rad] that are tried, or one number for an arm without.

        Those in the middle come first: they take the most poses, which the others need not try.
        """
        joint = self.solver.arm_angle_joint
        if joint is None:
            return np.zeros(1)
        low, high = self.chain.lower[joint], self.chain.upper[joint]
        step = (high - low) / ARM_ANGLES
        arm_angles = np.linspace(low + 0.5 * step, high - 0.5 * step, ARM_ANGLES)
        return arm_angles[np.argsort(np.abs(arm_angles - 0.5 * (low + high)), kind="stable")]

    def exact(
        self, q: FloatArray, T: FloatArray, axes: int | None = None
    ) -> tuple[IntArray, IntArray]:
        """Return the pose and the number of each of `q` (N, k, n) that takes `T` (N, 4, 4).

        It is inside the limits of the first ``axes``, of all by default.
        """
        chain, slack = self.chain, tolerances.LIMIT_SLACK
        lower, upper = chain.lower[:axes] - slack, chain.upper[:axes] + slack
        inside = ((q[..., :axes] >= lower) & (q[..., :axes] <= upper)).all(axis=-1)
        pose, branch = np.nonzero(inside)
        # Postures for a pose out of reach are only near it.
        distance, turn = errors_of(chain, q[pose, branch][:, None], T[pose])
        # The arm angles are solved for the exact arm, beside which the file describes this one.
        off = self.solver.file_offset or 0.0
        exact = (distance <= tolerances.SAME_POSITION + off) & (
            turn <= tolerances.SAME_ROTATION + off
        )
        good = exact[:, 0]
        good[good] = self.accepts(q[pose[good], branch[good]])
        return pose[good], branch[good]


@dataclass(frozen=True, eq=False)
class PitchesAndRolls:
    """The pitches and rolls that an arm of the five-axis family chooses from.

    A tool point beside the roll axis moves as the tool rolls, so each roll is then solved by
    itself; else one posture gives all rolls. Everything is computed on the canonical arm, whose
    frame is {C} (maths/kinematics/arm.py).
    """

    solver: PoseSolver
    pitches: int
    rolls: int

    @property
    def number(self) -> int:
        """The number of pairs of pitch and roll."""
        return self.pitches * self.rolls

    @property
    def poses_at_once(self) -> int:
        """The number of pitches."""
        return self.pitches

    def possible(self, p: FloatArray) -> BoolArray:
        """Return (N, number) whether each pair is possible at `p` (N, 3) [m] in {S}."""
        arm = arm_of(self.solver.chain)
        p_C = p @ arm.T_C_S[:3, :3].T + arm.T_C_S[:3, 3]
        possible = np.zeros((len(p) * self.pitches, self.rolls), dtype=np.bool)
        has_offset = arm.off_axis > 0.0
        for roll in range(self.rolls if has_offset else 1):
            # The rolls that a posture can take: all of them, or only the one that it is for.
            rolls = slice(roll, roll + 1) if has_offset else slice(None)
            for poses in self._tool_poses(p_C, roll):
                T = poses.reshape(-1, 4, 4)
                q = self.solver.solver.inverse_batch(T)
                pose, branch = self.solver.exact(q, T, axes=4)
                rollable = self._rollable(q[pose, branch, 4])[:, : 1 if has_offset else None]
                for number in range(q.shape[1]):
                    on_branch = branch == number
                    possible[pose[on_branch], rolls] |= rollable[on_branch]
        return possible.reshape(len(p), self.number)

    def _tool_poses(self, p: FloatArray, roll: int = 0) -> Iterator[FloatArray]:
        """Yield T_S_tool (N, pitches, 4, 4) at ``p`` (N, 3) of {C} [m], at a step of the roll.

        Pitch 0 is outward and positive pitch downwards. The first item is for the arm facing the
        points. If that gives another plane, a second item is for the arm with its back to them.
        """
        arm = arm_of(self.solver.chain)
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
            offset = np.stack((c * out - s * side, s * out + c * side, up + 0.0 * c), axis=-1)
            T_C_K = _roll_frames(p[:, None, :] - offset, c, s, phi)
            yield T_S_C @ T_C_K @ roll_K @ arm.T_K_tool

    def _rollable(self, theta5: FloatArray) -> BoolArray:
        """Return (N, rolls) whether axis 5 can add each roll to its angle ``theta5`` (N,) [rad]."""
        lower, upper = self.solver.chain.lower[4], self.solver.chain.upper[4]
        slack = tolerances.LIMIT_SLACK
        turn = arm_of(self.solver.chain).signs[4] * math.tau / self.rolls
        rolls = turn * np.arange(self.rolls)
        beyond_lower = np.mod(theta5[:, None] + rolls - lower + slack, math.tau)
        fits: BoolArray = beyond_lower <= upper - lower + 2.0 * slack
        return fits


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


GOLDEN: Final = math.pi * (3.0 - math.sqrt(5.0))
"""[rad] Golden angle, by which neighbouring directions on a sphere are turned."""


@dataclass(frozen=True, eq=False)
class Rotations:
    """The orientations that six and seven axes choose from.

    Attributes:
        solver: the test of poses.
        R: rotations (K, 3, 3) in {S}.
    """

    solver: PoseSolver
    R: FloatArray

    @property
    def number(self) -> int:
        """The number of rotations."""
        return len(self.R)

    @property
    def poses_at_once(self) -> int:
        """All of them."""
        return self.number

    def possible(self, p: FloatArray) -> BoolArray:
        """Return (N, number) whether each is possible at `p` (N, 3) [m] in {S}."""
        T = np.zeros((len(p), self.number, 4, 4))
        T[..., :3, :3] = self.R
        T[..., :3, 3] = p[:, None]
        T[..., 3, 3] = 1.0
        return self.solver.taken(T.reshape(-1, 4, 4)).reshape(len(p), self.number)


@dataclass(frozen=True, eq=False)
class Reachability:
    """The test of orientations at points.

    Attributes:
        chain: the arm with its tool, in {S}.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
        table: height z of the table in the base frame [m].
        pitches: number of pitches in a turn; of six and seven axes that of directions of the tool.
        rolls: number of rolls in a turn, for each pitch or direction.
    """

    chain: Chain
    T_base_shoulder: FloatArray
    table: float
    pitches: int
    rolls: int

    @cached_property
    def _links(self) -> DHLinks:
        return links_of(self.chain, exact=False)

    @cached_property
    def orientations(self) -> PitchesAndRolls | Rotations:
        """The orientations that are tried at a point."""
        kinematics = kinematics_of(self.chain)
        solver = PoseSolver(kinematics, self.clear)
        if kinematics.is_pitched:
            return PitchesAndRolls(solver, self.pitches, self.rolls)
        R = self.T_base_shoulder[:3, :3].T @ rotations(self.pitches, self.rolls)
        return Rotations(solver, R)

    @property
    def reach(self) -> float:
        """A bound on the distance of the tool from ``middle`` [m]."""
        return self._links.reach

    @property
    def middle(self) -> FloatArray:
        """The place (3,) on axis 1 where link 1 begins, in the base frame [m]."""
        return (self.T_base_shoulder @ self._links.T_S_1)[:3, 3]

    def count(self, points: FloatArray) -> IntArray:
        """Return the number of possible orientations (N,) at ``points`` (N, 3) in the base [m]."""
        far = ((points - self.middle) ** 2).sum(axis=1) > self.reach**2
        near = np.flatnonzero((points[:, 2] >= self.table) & ~far)
        p = (points[near] - self.T_base_shoulder[:3, 3]) @ self.T_base_shoulder[:3, :3]
        counts = np.zeros(len(points), dtype=np.int64)
        counts[near] = self.orientations.possible(p).sum(axis=1)
        return counts

    def reached(self, ranges: tuple[range, range, range], size: float) -> FloatArray:
        """Return the centres (N, 3) [m] of the voxels in which a random posture has its tool point.

        ``ranges``, ``size`` [m]: see `voxel_ranges`.
        """
        chain, rng = self.chain, np.random.default_rng(self.chain.n)
        first, counts = ([side.start for side in ranges], [len(side) for side in ranges])
        is_reached = np.zeros(counts, dtype=np.bool)
        for _ in range(SAMPLES // POSES):
            q = rng.uniform(chain.lower, chain.upper, (POSES, chain.n))
            p = forward_batch(chain, q[self.clear(q)])[:, :3, 3]
            p = p @ self.T_base_shoulder[:3, :3].T + self.T_base_shoulder[:3, 3]
            voxels = np.floor(p / size).astype(np.int64) - first
            inside = ((voxels >= 0) & (voxels < counts)).all(axis=1)
            is_reached[tuple(voxels[inside].T)] = True
        return voxel_centers(ranges, size)[is_reached.ravel()]

    def clear(self, q: FloatArray) -> BoolArray:
        """Return (N,) whether no axis from the third on is below the table at `q` (N, n) [rad]."""
        links, alpha = self._links, q + self._links.shift
        T: FloatArray = np.broadcast_to(self.T_base_shoulder @ links.T_S_1, (len(q), 4, 4))
        lowest = np.full(len(q), np.inf)
        turn = np.zeros((len(q), 4, 4))
        turn[:, 2, 2] = turn[:, 3, 3] = 1.0
        for k in range(links.n - 1):
            c, s = np.cos(alpha[:, k]), np.sin(alpha[:, k])
            turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1] = c, -s, s, c
            T = T @ turn @ links.link(k)
            if k > 0:
                lowest = np.minimum(lowest, T[:, 2, 3])
        return np.asarray(lowest >= self.table)


def rotations(directions: int, rolls: int) -> FloatArray:
    """Return rotations (directions * rolls, 3, 3) that are spread evenly.

    Their z axes lie on a spiral over the sphere, at the golden angle from one to the next, each
    with ``rolls`` turns about it.
    """
    heights = 1.0 - (2.0 * np.arange(directions) + 1.0) / directions
    across = np.sqrt(1.0 - heights * heights)
    azimuth = GOLDEN * np.arange(directions)
    z = np.stack((across * np.cos(azimuth), across * np.sin(azimuth), heights), axis=1)
    matrices = []
    for direction in z:
        other = np.eye(3)[int(np.abs(direction).argmin())]
        x = np.cross(other, direction)
        x /= np.linalg.norm(x)
        R = np.column_stack((x, np.cross(direction, x), direction))
        matrices += [R @ so3.rotation_z(math.tau * roll / rolls) for roll in range(rolls)]
    return np.array(matrices)


POSES: Final = 65536
"""Number of poses that are solved at once; they take 50 MB."""

SAMPLES: Final = 16 * POSES
"""Number of random postures of an arm that chooses no orientation."""

MIN_VOXEL = 1e-3
"""[m] Minimum edge of a voxel: the accuracy of the arm's joints at the tool."""


def voxel_ranges(
    middle: npt.ArrayLike, reach: float, size: float, table: float
) -> tuple[range, range, range]:
    """Return the numbers in x, y, z of the voxels of the ball of ``reach`` [m] about ``middle``.

    Voxel i has the edge ``size`` [m] and begins at i * size in the base frame. ``table`` is a
    height z [m]; voxels with their centre below it are left out. Raises InputError for an invalid
    ``size``, and for a table above the reach.
    """
    centre = finite_array(middle, (3,), "The centre of the reach")
    if not MIN_VOXEL <= size <= reach:
        raise InputError(
            f"The edge of a voxel is {1e3 * size:g} mm; it must be from "
            f"{1e3 * MIN_VOXEL:g} to {1e3 * reach:.0f} mm."
        )
    top = float(centre[2]) + reach
    if not -math.inf < table < top:
        raise InputError(
            f"A table at {1e3 * table:g} mm leaves no reachable space above it. The tool "
            f"reaches up to {1e3 * top:.0f} mm."
        )
    low = np.floor((centre - reach) / size).astype(int).tolist()
    high = np.ceil((centre + reach) / size).astype(int).tolist()
    low[2] = max(low[2], math.ceil(table / size - 0.5))
    high[2] = max(high[2], low[2] + 1)
    x, y, z = map(range, low, high)
    return x, y, z


def voxel_centers(ranges: tuple[range, range, range], size: float) -> FloatArray:
    """Return the centres (N, 3) of all voxels of ``ranges`` in the base frame [m], z first."""
    axes = [(np.array(numbers) + 0.5) * size for numbers in ranges]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """The points that a tool reaches, in the base frame [m].

    Attributes:
        points: (N, 3) centres of the voxels with at least one orientation.
        fraction: (N,) fraction of orientations in each voxel, above 0 and up to 1.
    """

    points: FloatArray
    fraction: FloatArray


ROUND: Final = 0.005
"""[m] The edge of a voxel is a multiple of this by default."""


class Fineness(NamedTuple):
    """The fineness of the map of an arm.

    Attributes:
        voxels: number of voxels from the middle of the reach to its end.
        pitches, rolls: numbers of steps.
        poses: maximum number of poses in the box around the reach.
    """

    voxels: int
    pitches: int
    rolls: int
    poses: int


FAMILY: Final = Fineness(32, 36, 24, 2_000_000_000)
CLOSED: Final = Fineness(16, 24, 6, 100_000_000)
SEVEN_AXES: Final = Fineness(10, 12, 4, 10_000_000)
POINTS: Final = Fineness(10, 1, 1, SAMPLES // 50)


def reachability_map(
    chain: Chain, T_base_shoulder: FloatArray, table: float = 0.0, voxel: float | None = None
) -> ReachabilityMap:
    """Return the map of the arm ``chain``.

    Args:
        chain: the arm with its tool, in {S}.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
        table: height of the table in the base frame [m].
        voxel: edge of a voxel [m]; None for what suits the arm.

    Raises InputError for a value out of range, and for a map that would take too long.
    """
    kinematics = kinematics_of(chain)
    fineness = _fineness(kinematics)
    arm = Reachability(chain, T_base_shoulder, table, fineness.pitches, fineness.rolls)
    if voxel is None:
        voxel = ROUND * math.ceil(arm.reach / fineness.voxels / ROUND)
    ranges = voxel_ranges(arm.middle, arm.reach, voxel, table)
    chooses = fineness is not POINTS
    poses = math.prod(map(len, ranges)) * (arm.orientations.number if chooses else 1)
    if poses > fineness.poses:
        raise InputError(
            f"The map would take {poses:.2g} poses, and at most {fineness.poses:.0e} are tried for "
            f"this arm ({kinematics.method}). Choose larger voxels than {1e3 * voxel:g} mm."
        )
    if not chooses:
        points = arm.reached(ranges, voxel)
        return ReachabilityMap(points, np.ones(len(points)))
    centers = voxel_centers(ranges, voxel)
    step = max(1, POSES // arm.orientations.poses_at_once)
    starts = range(0, len(centers), step)
    counts = np.concatenate([arm.count(centers[start : start + step]) for start in starts])
    reached = np.flatnonzero(counts)
    return ReachabilityMap(centers[reached], counts[reached] / arm.orientations.number)


def _fineness(kinematics: Kinematics) -> Fineness:
    if kinematics.is_pitched:
        return FAMILY
    if kinematics.arm_angle_joint is not None:
        return SEVEN_AXES
    return CLOSED if kinematics.is_exact else POINTS
