"""The fraction of tool orientations that an arm outside the five-axis family can have at a point.

The orientations that are tried depend on what the arm can choose:

    six and more axes   directions of the z axis of the tool, spread evenly over the sphere, with
                        turns about each; orientations in the base frame.
    four axes           directions of the tool in the upright plane of the arm through the point.
                        Either shoulder posture may hold them.
    all others          any orientation counts as one.

The orientation of the tool at Home is tried too, and reported by itself. With four axes that is its
direction in the plane. An orientation counts if a posture takes it with every joint inside its
limits, and no axis from the third on is below the table where its link begins. Contacts of bodies
are not checked. Of seven axes the swivel is tried at some angles, and a numerical search begins at
few postures; so both can miss an orientation, but count none too many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, cast

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.links import DHLinks, links_of
from katana450.extensions.general_arms.numerical import Numerical
from katana450.extensions.reachability.grid import IntArray, VoxelGrid
from katana450.extensions.reachability.plane_directions import PlaneDirections
from katana450.extensions.reachability.point_search import PointSearch
from katana450.extensions.reachability.pose_solver import BoolArray, PoseSolver, Solver
from katana450.extensions.reachability.reachability import check_steps
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward

POSES_OF_SEARCH: Final = 64
"""Number of poses in closed form that take about as long as a search."""

GOLDEN: Final = math.pi * (3.0 - math.sqrt(5.0))
"""[rad] Golden angle, by which neighbouring directions on a sphere are turned."""


@dataclass(frozen=True, eq=False)
class PoseReachability:
    """The test of orientations at points; see ``Reachability``.

    Attributes:
        chain: the arm with its tool, in {S}.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
        table: height z of the table in the base frame [m].
        pitches: number of directions of the tool.
        rolls: number of turns about each direction, from six axes on.
        home: (n,) joint angles of Home [rad].

    Raises InputError for a number of steps outside 1 to MAX_STEPS.
    """

    chain: Chain
    T_base_shoulder: FloatArray
    table: float
    pitches: int
    rolls: int
    home: FloatArray

    def __post_init__(self) -> None:
        check_steps(self.pitches, self.rolls)

    @property
    def _solver(self) -> Solver:
        return cast(Solver, kinematics_of(self.chain))

    @cached_property
    def _poses(self) -> PoseSolver:
        return PoseSolver(self._solver, self.clear)

    @cached_property
    def _links(self) -> DHLinks:
        return links_of(self.chain, exact=False)

    @cached_property
    def _plane(self) -> PlaneDirections | None:
        """The directions that four axes choose from; None for other arms."""
        solver = self._solver
        if self.chain.n != 4 or not isinstance(solver, ClosedForm):
            return None
        return PlaneDirections.of(solver, self._poses, self.pitches, self.home)

    @cached_property
    def _rotations(self) -> FloatArray:
        """The orientations (K, 3, 3) in {S} that six axes choose from, that at Home last."""
        R_S_base = self.T_base_shoulder[:3, :3].T
        at_home = forward(self.chain, self.home)[None, :3, :3]
        return np.concatenate((R_S_base @ rotations(self.pitches, self.rolls), at_home))

    @property
    def orientations(self) -> int:
        """The number of orientations that are tried at a point."""
        if self.chain.n >= 6:
            return self.pitches * self.rolls + 1
        return 1 if self._plane is None else self.pitches + 1

    @property
    def poses_at_once(self) -> int:
        """The number of poses that are tried at once for each point.

        A search counts as many, so that its progress is seen.
        """
        is_search = isinstance(self._solver, Numerical)
        return self.orientations * (POSES_OF_SEARCH if is_search else 1)

    @property
    def reach(self) -> float:
        """A bound on the distance of the tool from axis 1 where link 1 begins [m]."""
        return self._links.reach

    def grid(self, voxel: float) -> VoxelGrid:
        """Return the voxels of edge ``voxel`` [m] that may have a reachable point."""
        middle = (self.T_base_shoulder @ self._links.T_S_1)[:3, 3]
        return VoxelGrid.around(middle, self.reach, voxel, self.table)

    def count(self, points: FloatArray) -> IntArray:
        """Return the counts (N, 2) at ``points`` (N, 3), in the base frame [m].

        The first is the number of possible orientations, the second 1 if that at Home is one. Of an
        arm that chooses none, it is the first alone (N,).
        """
        middle = (self.T_base_shoulder @ self._links.T_S_1)[:3, 3]
        far = ((points - middle) ** 2).sum(axis=1) > self.reach**2
        near = np.flatnonzero((points[:, 2] >= self.table) & ~far)
        p = (points[near] - self.T_base_shoulder[:3, 3]) @ self.T_base_shoulder[:3, :3]
        possible = self._possible(p)
        counts = np.zeros((len(points), 2), dtype=np.int64)
        counts[near, 0] = possible.sum(axis=1)
        counts[near, 1] = possible[:, -1]
        return counts if self.orientations > 1 else counts[:, 0]

    def _possible(self, p: FloatArray) -> BoolArray:
        """Return (N, orientations) whether each is possible at `p` (N, 3) [m] in {S}."""
        if self.chain.n < 6:
            plane = self._plane
            return self._points.reached(p) if plane is None else plane.possible(p)
        T = np.zeros((len(p), self.orientations, 4, 4))
        T[..., :3, :3] = self._rotations
        T[..., :3, 3] = p[:, None]
        T[..., 3, 3] = 1.0
        return self._poses.taken(T.reshape(-1, 4, 4)).reshape(len(p), self.orientations)

    @cached_property
    def _points(self) -> PointSearch:
        return PointSearch(self.chain, self.clear)

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
    found = []
    for direction in z:
        other = np.eye(3)[int(np.abs(direction).argmin())]
        x = np.cross(other, direction)
        x /= np.linalg.norm(x)
        R = np.column_stack((x, np.cross(direction, x), direction))
        found += [R @ so3.rotation_z(math.tau * roll / rolls) for roll in range(rolls)]
    return np.array(found)
