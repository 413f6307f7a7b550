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
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, cast

import numpy as np

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.descent import Descent
from katana450.extensions.general_arms.links import DHLinks, links_of
from katana450.extensions.general_arms.numerical import Numerical
from katana450.extensions.general_arms.regularity import Regularity
from katana450.extensions.general_arms.swivel import SevenAxes
from katana450.extensions.reachability.reachability import (
    BoolArray,
    IntArray,
    VoxelGrid,
    check_steps,
)
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import errors_of, forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget

Solver = ClosedForm | SevenAxes | Numerical
"""The kinematics of arms outside the five-axis family."""

SWIVELS: Final = 16
"""Number of angles of the swivel of seven axes that are tried for a pose."""

SEEDS: Final = 6
"""Number of postures from which a numerical search for a pose begins."""


@dataclass(frozen=True, eq=False)
class PoseSolver:
    """The test of one arm.

    Attributes:
        solver: its kinematics.
        accepts: returns (N,) whether postures (N, n) [rad] inside the limits may be taken.
    """

    solver: Solver
    accepts: Callable[[FloatArray], BoolArray]

    @property
    def chain(self) -> Chain:
        """The chain."""
        return self.solver.chain

    def taken(self, T: FloatArray) -> BoolArray:
        """Return (N,) whether a posture inside the limits takes the pose, for `T` (N, 4, 4)."""
        match self.solver:
            case ClosedForm():
                return self._exact(self.solver.solve_batch(T), T)
            case SevenAxes():
                return self._with_swivel(self.solver, T)
            case Numerical():
                return self._searched(self.solver, T)

    def _with_swivel(self, solver: SevenAxes, T: FloatArray) -> BoolArray:
        low, high = self.chain.lower[solver.swivel], self.chain.upper[solver.swivel]
        step = (high - low) / SWIVELS
        swivels = np.linspace(low + 0.5 * step, high - 0.5 * step, SWIVELS)
        taken = np.zeros(len(T), dtype=np.bool)
        # Those in the middle take the most poses, which the others need not try.
        for swivel in swivels[np.argsort(np.abs(swivels - 0.5 * (low + high)), kind="stable")]:
            left = np.flatnonzero(~taken)
            q = solver.at_swivels(T[left], np.full(len(left), swivel))
            taken[left] = self._exact(q, T[left])
        return taken

    def _searched(self, solver: Numerical, T: FloatArray) -> BoolArray:
        taken = np.zeros(len(T), dtype=np.bool)
        hint = None
        for number, pose in enumerate(T):
            q = np.array(solver.solve(pose, hint, SEEDS))
            taken[number] = self._exact(q[None, None], pose[None])[0]
            # The next pose is often near this one.
            hint = q if taken[number] else None
        return taken

    def _exact(self, q: FloatArray, T: FloatArray) -> BoolArray:
        """Return (N,) whether one of `q` (N, k, n) is inside the limits and takes `T` (N, 4, 4)."""
        chain, slack = self.chain, tolerances.LIMIT_SLACK
        inside = ((q >= chain.lower - slack) & (q <= chain.upper + slack)).all(axis=-1)
        pose, branch = np.nonzero(inside)
        chosen = q[pose, branch]
        # Postures for a pose out of reach are only near it.
        distance, turn = errors_of(chain, chosen[:, None], T[pose])
        # The swivels are solved for the exact arm, beside which the file describes this one.
        off = 0.0 if isinstance(self.solver, Numerical) else self.solver.rounding.offset
        exact = (distance <= tolerances.SAME_POSITION + off) & (
            turn <= tolerances.SAME_ROTATION + off
        )
        good = exact[:, 0] & self.accepts(chosen)
        taken = np.zeros(len(T), dtype=np.bool)
        taken[pose[good]] = True
        return taken


STARTS: Final = 4
"""Number of postures from which a search begins, those with the nearest tool points first."""

SAMPLES: Final = 20_000
"""Number of random postures from which these are taken."""

EFFORT: Final = 60
"""Maximum effort of one search, in looks."""

REACHED: Final = 1e-6
"""[m] Distance from a point up to which the tool point is there."""


@dataclass(frozen=True, eq=False)
class PointSearch:
    """The search of one arm.

    Attributes:
        chain: the chain.
        accepts: returns (N,) whether postures (N, n) [rad] may be taken.
    """

    chain: Chain
    accepts: Callable[[FloatArray], BoolArray]

    @cached_property
    def _descent(self) -> Descent:
        search = Numerical(self.chain, links_of(self.chain, exact=False))
        return Descent(search, Regularity(self.chain.n))

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Postures (M, n) [rad] that may be taken, and their tool points (M, 3) [m]."""
        chain = self.chain
        q = np.random.default_rng(chain.n).uniform(chain.lower, chain.upper, (SAMPLES, chain.n))
        q = q[self.accepts(q)]
        return q, forward_batch(chain, q)[:, :3, 3]

    def reached(self, p: FloatArray) -> BoolArray:
        """Return (N, 1) whether the tool point can be at `p` (N, 3) [m] in {S}."""
        return np.array([self._reaches(point) for point in p], dtype=np.bool).reshape(-1, 1)

    def _reaches(self, point: FloatArray) -> bool:
        q, points = self._table
        if not len(q):
            return False
        goal = self._descent.goal(ToolTarget.of(se3.from_rotation_translation(np.eye(3), point)))
        far = ((points - point) ** 2).sum(axis=1)
        for start in q[np.argsort(far, kind="stable")[:STARTS]].tolist():
            end = self._descent.run(goal, tuple(start), Priority.POSITION, EFFORT).q
            look = self._descent.look(goal, end)
            near = self._descent.misses(look, Priority.POSITION)[0] <= REACHED
            if near and self.accepts(np.array([end]))[0]:
                return True
        return False


UPRIGHT: Final = 1e-6
"""[1] Cosine between axes 1 and 4 up to which the plane of the arm is upright."""

FACING: Final = 2
"""Number of branches whose shoulder faces the tool point; they come first."""


@dataclass(frozen=True, eq=False)
class PlaneDirections:
    """The directions that are tried for one arm.

    Attributes:
        form: its closed form.
        solver: the test of poses.
        turns: (2, K) the turn about axis 4 [rad] that gives each direction: if the shoulder faces
            the point, and if it has its back to it.
    """

    form: ClosedForm
    solver: PoseSolver
    turns: FloatArray

    @classmethod
    def of(
        cls, form: ClosedForm, solver: PoseSolver, steps: int, home: FloatArray
    ) -> PlaneDirections | None:
        """Return ``steps`` directions in a turn, and as the last that at ``home`` (4,) [rad].

        None for an arm whose plane is not upright.
        """
        chain = form.chain
        up, across = chain.S[:3, 0], chain.S[:3, 3]
        if abs(float(up @ across)) > UPRIGHT:
            return None
        outward = np.cross(up, across)
        # A turn about axis 4 adds to an angle in this plane.
        plane = np.stack((outward, np.cross(across, outward)))
        seen = plane @ chain.M[:3, :3]
        # The axis of the tool that lies in the plane; of two the first.
        axis = int(np.round(np.linalg.norm(seen, axis=0), 6).argmax())
        start = math.atan2(seen[1, axis], seen[0, axis])
        T = forward(chain, home)
        at_home = plane @ so3.exp(-float(home[0]) * up) @ T[:3, axis]
        there = math.atan2(at_home[1], at_home[0])
        away = np.array(form.solve(T, home.tolist())) - home
        away -= math.tau * np.round(away / math.tau)
        if int(np.abs(away).max(axis=1).argmin()) >= FACING:
            there = math.pi - there
        angles = np.append(np.linspace(0.0, math.tau, steps, endpoint=False), there)
        # Seen from the back of the arm, outward is opposite.
        return cls(form, solver, np.stack((angles - start, math.pi - angles - start)))

    def possible(self, p: FloatArray) -> BoolArray:
        """Return (N, K) whether each direction is possible at `p` (N, 3) [m] in {S}."""
        chain, count = self.form.chain, self.turns.shape[1]
        T = np.zeros((len(p), count, 4, 4))
        T[..., 3, 3] = 1.0
        T[..., :3, 3] = p[:, None]
        T[:, 0, :3, :3] = chain.M[:3, :3]
        # The point alone decides axis 1, apart from the side that faces it.
        pans = self.form.solve_batch(T[:, 0])[:, ::FACING, 0]
        found = np.zeros((len(p), count), dtype=np.bool)
        for pan, turns in zip(pans.T, self.turns, strict=True):
            turned = np.array([so3.exp(turn * chain.S[:3, 3]) for turn in turns])
            panned = np.array([so3.exp(angle * chain.S[:3, 0]) for angle in pan]).reshape(-1, 3, 3)
            T[..., :3, :3] = panned[:, None] @ (turned @ chain.M[:3, :3])
            found |= self.solver.taken(T.reshape(-1, 4, 4)).reshape(len(p), count)
        return found


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
