"""The kinematics of arms outside the five-axis family, as a session drives their tool.

`PoseTracker` follows a dragged pose: the goal moves on from its present posture along the path of
the drag. Six axes with a closed form take the posture of their branch at each place of the path, if
it is a hop away. At limits, out of reach, and for all other arms, `Descent` leads the goal on. Its
steps can turn the arm angle of seven axes to the edge of the branch; a way that leads on with the
arm angle as it was is then taken. The goal stays on its branch and never leaps; a pose that only a
leap would reach is reported.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import ClassVar, Final

import numpy as np

from katana450 import tolerances
from katana450.arm.control.commands.tool_commands import Orient, StepTool, TurnCommand
from katana450.arm.control.state.messages import PRIORITIES, PRIORITY_HINTS
from katana450.arm.control.state.state import Finding, State
from katana450.arm.control.tool_kinematics import ToolKinematics
from katana450.arm.robot.arm_reader import OtherArm, described_chain
from katana450.arm.robot.structure import Structure, structure_of
from katana450.arm.robot.urdf import Urdf
from katana450.caching import cached_property
from katana450.errors import RobotDescriptionError
from katana450.extensions.general_arms.branch_words import in_order_for_people
from katana450.extensions.general_arms.choice import exact_arm, kinematics_of
from katana450.extensions.general_arms.descent import NEAR, WALL, Angles, Descent, descent_of
from katana450.extensions.general_arms.nearest import losses_of, nearest_posture, projected
from katana450.extensions.general_arms.pose_equations import equations_from
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import POSITION_WORTH_TELLING, Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import HOP, MIN_LEAP_GAIN, Tracked, stops_between
from katana450.maths.kinematics.velocity import JogFrame

MAX_EFFORT: Final = 20
"""Maximum effort of one call, in looks at a posture. The next call continues."""

MIN_EFFORT: Final = 8
"""Minimum effort of the descent on a stride, so that it makes some steps."""

EFFORT_OF_FORM: Final = 2
"""Effort of a posture in closed form, in looks."""

LEAST_PART: Final = 1.0 / 32.0
"""[1] Smallest part of a stride that the closed form is asked for."""

ARM_ANGLE_SAMPLES: Final = 24
"""Number of places of a stride to which a branch of seven axes is followed with its arm angle."""

EXACT: Final = 1e-8
"""[rad], [arm lengths] Error of the pose up to which a closed form's posture takes it."""


@dataclass(frozen=True, eq=False)
class PoseTracker:
    """The tracker of one arm. Its methods are pure."""

    descent: Descent
    branches: Kinematics

    @property
    def chain(self) -> Chain:
        """The chain."""
        return self.descent.search.chain

    def track(
        self,
        q: FloatArray,
        target: ToolTarget,
        since: ToolTarget,
        branch: str,
        priority: Priority,
        projected: Callable[[FloatArray], Projection],
    ) -> Tracked:
        """Return the goal moved on from `q` (n,) [rad] on ``branch`` towards ``target``.

        ``projected`` returns the projection of ``target`` that joint angles give.
        """
        angles, effort, place = tuple(self.chain.clamp(q).tolist()), MAX_EFFORT, since
        for stop in itertools.chain(stops_between(since, target), (target,)):
            before = angles
            angles, effort, ended = self._advanced(angles, place, stop, branch, priority, effort)
            if place is since and not ended and self._is_led_along_edge(angles, stop, priority):
                at_arm_angle = self._at_its_arm_angle(before, stop, branch)
                angles, ended = (angles, False) if at_arm_angle is None else (at_arm_angle, True)
            if not ended or (effort <= 0 and stop is not target):
                return Tracked(projected(np.array(angles)), since=stop if ended else place)
            place = stop
        goal = np.array(angles)
        beyond = self._beyond(goal, target, branch, priority)
        return Tracked(projected(goal), None if beyond is None else projected(beyond))

    def _advanced(
        self,
        q: Angles,
        start: ToolTarget,
        stop: ToolTarget,
        branch: str,
        priority: Priority,
        effort: int,
    ) -> tuple[Angles, int, bool]:
        """Return `q` moved from ``start`` to ``stop``, the effort left, and whether it is done."""
        done, part = 0.0, 1.0
        while self.branches.is_exact and priority is Priority.POSE and done < 1.0 and effort > 0:
            place = stop if done + part >= 1.0 else start.towards(stop, done + part)
            angles = self._exact(place, branch, q)
            effort -= EFFORT_OF_FORM
            if angles is None or part < LEAST_PART:
                break
            if max(abs(a - b) for a, b in zip(angles, q, strict=True)) > HOP:
                part *= 0.5
                continue
            q, done = angles, min(done + part, 1.0)
            part = min(2.0 * part, 1.0 - done)
        if done >= 1.0:
            return q, effort, True
        goal = self.descent.goal(stop)
        end = self.descent.run(goal, q, priority, max(effort, MIN_EFFORT))
        effort -= end.effort
        if self.descent.look(goal, q).least < WALL and self._leaves(end.q, branch):
            return q, effort, True
        return end.q, effort, end.ended

    def _is_led_along_edge(self, q: Angles, stop: ToolTarget, priority: Priority) -> bool:
        """Return whether steps of seven axes towards ``stop`` ended at the edge of the branch."""
        if self.branches.arm_angle_joint is None or priority is not Priority.POSE:
            return False
        now = self.descent.look(self.descent.goal(stop), q)
        return now.least < NEAR and float(np.abs(now.error).max()) > EXACT

    def _at_its_arm_angle(self, q: Angles, stop: ToolTarget, branch: str) -> Angles | None:
        """Return the posture of ``branch`` at ``stop`` with the arm angle of `q`.

        None without a way there. On it every posture is inside the limits, clear of the edge, and a
        hop from the last.
        """
        near = np.array(q)
        number = self.branches.branches.index(branch)

        def on_branch(places: Sequence[ToolTarget]) -> FloatArray:
            T = np.array([place.T for place in places])
            postures = self.branches.at_arm_angle_of(T, near)
            assert postures is not None
            return postures[:, number]

        if not self._takes(stop, on_branch([stop])[0]):
            return None
        start = ToolTarget.of(forward(self.chain, near))
        places = [
            *(start.towards(stop, k / ARM_ANGLE_SAMPLES) for k in range(1, ARM_ANGLE_SAMPLES)),
            stop,
        ]
        steps = np.diff(on_branch(places), axis=0, prepend=near[None])
        steps -= math.tau * np.round(steps / math.tau)
        postures = near + np.cumsum(steps, axis=0)
        leads = np.abs(steps).max() <= HOP and all(map(self._takes, places, postures))
        return tuple(self.chain.clamp(postures[-1]).tolist()) if leads else None

    def _takes(self, place: ToolTarget, q: FloatArray) -> bool:
        """Return whether `q` (n,) takes the pose inside the limits, clear of the edge."""
        if not (np.isfinite(q).all() and self.chain.within_limits(q)):
            return False
        now = self.descent.look(self.descent.goal(place), tuple(q.tolist()))
        return now.least >= WALL and float(np.abs(now.error).max()) <= EXACT

    def _leaves(self, q: Angles, branch: str) -> bool:
        return self.branches.are_separate and self.branches.branch_of(np.array(q)) != branch

    def _exact(self, place: ToolTarget, branch: str, q: Angles) -> Angles | None:
        """Return the posture of ``branch`` at ``place`` inside the limits; None without one."""
        near = np.array(q)
        posture = self.branches.on_branch(place.T, branch, near)
        if posture is None or not self.chain.within_limits(posture):
            return None
        angles = tuple(self.chain.clamp(posture).tolist())
        now = self.descent.search.step(self.descent.goal(place), angles)
        return angles if now.square <= EXACT * EXACT else None

    def _beyond(
        self, q: FloatArray, target: ToolTarget, branch: str, priority: Priority
    ) -> FloatArray | None:
        """Return the exact posture of the branch for ``target``, if `q` (n,) misses it."""
        goal = self.descent.goal(target)
        misses = self.descent.misses(self.descent.look(goal, tuple(q.tolist())), priority)
        if max(misses) <= MIN_LEAP_GAIN or self.chain.n < 6:
            return None
        posture = self.branches.on_branch(target.T, branch, q)
        if posture is None or not self.chain.within_limits(posture):
            return None
        posture = self.chain.clamp(posture)
        after = self.descent.look(goal, tuple(posture.tolist()))
        exact = max(map(abs, after.error.tolist())) <= math.sqrt(tolerances.SAME_POSITION)
        return posture if exact else None


ANGLES: Final = tuple(np.radians((0.0, 45.0, -45.0, 90.0, -90.0, 135.0, -135.0)).tolist())
"""[rad] Angles that are tried for the joints that turn."""

ROOM: Final = 0.1
"""[1] Minimum distance from the limits, as a fraction of the range of a joint."""

HEIGHT: Final = 0.35
"""[1] Preferred height of the tool over the base, as a fraction of the reach of the arm."""

REGULAR: Final = 0.25
"""[1] Smallest singular value from which on a posture is far enough from a singularity."""

MAX_COMPARED: Final = 400
"""Maximum number of postures whose axes are compared; the pose of the tool chooses them."""


def ready_posture(descent: Descent, T_base_shoulder: FloatArray) -> FloatArray:
    """Return the joint angles (n,) [rad] of a useful first posture.

    The first joint, the last one of arms with six and more axes, and the third one of arms with
    seven stand at zero if their limits allow it. The others have multiples of 45 degrees: far from
    a singularity, with the tool in front of the base and at a medium height, no axis behind the
    shoulder much lower than that, and turned as little as that allows.
    """
    chain = descent.search.chain
    q = _candidates(chain)
    T = T_base_shoulder @ forward_batch(chain, q)
    reach = descent.search.links.reach
    along = np.abs(T[:, :3, :3]).max(axis=2)
    score = 0.5 * along[:, 2] + 0.25 * along.min(axis=1)
    score += 0.5 * np.clip(T[:, 0, 3] / reach, -0.5, 0.5) - np.abs(T[:, 2, 3] / reach - HEIGHT)
    score -= 0.02 * np.abs(q).sum(axis=1)
    best = np.argsort(-score, kind="stable")[:MAX_COMPARED]
    q, T, score = q[best], T[best], score[best]
    twists = [descent.search.motion(candidate)[1] for candidate in q.tolist()]
    score += np.minimum([_least(descent, twist) for twist in twists], REGULAR) / REGULAR
    score += np.minimum(_lowest_axis(np.array(twists), T, T_base_shoulder) / reach, HEIGHT)
    return np.array(q[int(score.argmax())])


def _candidates(chain: Chain) -> FloatArray:
    """Return postures (N, n) [rad] inside the limits."""
    room = ROOM * (chain.upper - chain.lower)
    lower, upper = (chain.lower + room).tolist(), (chain.upper - room).tolist()
    # A rail or a lift before the arm stands still too.
    first = sum(chain.slides)
    still = {*range(first + 1)} if chain.n < 6 + first else {*range(first + 1), chain.n - 1}
    # The third of seven axes moves the elbow aside: the arm stands in one plane without it.
    still |= set(range(first + 2, chain.n - 4))
    choices = []
    for k, (low, high) in enumerate(zip(lower, upper, strict=True)):
        inside = [angle for angle in ANGLES if low <= angle <= high]
        if k in still and 0.0 in inside:
            inside = [0.0]
        elif k in still or not inside:
            inside = [0.5 * (low + high)]
        choices.append(inside)
    return np.array(list(itertools.product(*choices)))


def _lowest_axis(twists: FloatArray, T: FloatArray, T_base_shoulder: FloatArray) -> FloatArray:
    """Return the heights (N,) [m] of the lowest of the axes 3 and on, each nearest to the tool.

    Args:
        twists: (N, n, 6) rotation and velocity of the tool point by each axis, in frame {S}.
        T: (N, 4, 4) poses of the tool in the base frame.
        T_base_shoulder: (4, 4) frame {S}.
    """
    w, v = twists[:, 2:, :3], twists[:, 2:, 3:]
    arms = np.cross(v, w) @ T_base_shoulder[2, :3]
    lowest: FloatArray = T[:, 2, 3] - arms.max(axis=1)
    return lowest


def _least(descent: Descent, moved: Sequence[Sequence[float]]) -> float:
    J = np.array(moved).T
    J[3:] /= descent.search.length
    return descent.regularity.least(descent.regularity.matrix(J))


SEARCH_EFFORT: Final = 60
"""Maximum effort of the search for the posture nearest to a typed pose, in looks."""

SETTLED: Final = 1e-9
"""[rad] Turn of axis 1 below which that search has settled."""

SETTLINGS: Final = 4
"""Maximum number of searches in which axis 1 and the pose of fewer than six axes settle."""

AT_EDGE: Final = 1.5 * WALL
"""[1] Smallest singular value up to which a posture counts as at the edge of its branch."""

SIX_PRIORITIES: Final[Mapping[Priority, tuple[str, str]]] = {
    Priority.POSE: (PRIORITIES[Priority.POSE], PRIORITY_HINTS[Priority.POSE]),
    Priority.POSITION: (
        "Position only",
        "The tool point goes to the target; its orientation is free.",
    ),
    Priority.ORIENTATION: (
        "Orientation, position",
        "The tool keeps the orientation of the target, and stops where it cannot.",
    ),
}


@dataclass(frozen=True, eq=False)
class DrivenTool(ToolKinematics):
    """The tool of an arm outside the five-axis family."""

    freedoms: ClassVar[int] = 6
    turn: ClassVar[type[TurnCommand]] = Orient
    priorities: ClassVar[Mapping[Priority, tuple[str, str]]] = SIX_PRIORITIES

    @cached_property
    def solver(self) -> Kinematics:
        """The closed form of the chain, or the search."""
        return kinematics_of(self.chain)

    @cached_property
    def _tracker(self) -> PoseTracker:
        return PoseTracker(descent_of(self.solver), self.solver)

    @property
    def branches(self) -> tuple[AnyBranch, ...]:
        """The names of the branches, those of usual postures first."""
        return in_order_for_people(self.solver.branches)

    def target_at(self, q: FloatArray) -> ToolTarget:
        """Return the pose of the tool at `q` (n,) [rad]."""
        return self._seen(forward(self.chain, q), q)

    def stepped(self, state: State, target: ToolTarget, step: StepTool) -> ToolTarget:
        """Return ``target`` moved by ``step``: x, y, z [m], then a rotation vector [rad]."""
        pan, by = self.pan(state.goal), step.by
        R = self.axes(state.goal, step.frame)
        turned = so3.exp(R @ by[3:]) @ pan @ target.R
        return ToolTarget(frozen(target.position + R @ by[:3]), rotation=frozen(pan.T @ turned))

    def track(self, state: State, target: ToolTarget, since: ToolTarget) -> Tracked:
        """Return the goal moved on towards ``target``, see `PoseTracker`."""
        branch = str(state.branch)

        def projected(q: FloatArray) -> Projection:
            name = branch if self.solver.are_separate else str(self.solver.branch_of(q))
            return self._projected(q, target, name, state.priority)

        return self._tracker.track(state.goal, target, since, branch, state.priority, projected)

    def _projected(
        self, q: FloatArray, target: ToolTarget, branch: str, priority: Priority
    ) -> Projection:
        T = np.array(target.T)
        T[:3, :3] = self.pan(q) @ T[:3, :3]
        return projected(self.chain, q, T, branch, priority)

    def project(self, state: State, T: FloatArray, branch: AnyBranch) -> Projection:
        """Return the posture on ``branch`` nearest to the pose `T` (4, 4).

        An arm without a closed form searches from the goal, and from other postures if that does
        not lead there.
        """
        return self._nearest(state, T, branch, partial(self._seen, T))

    def leap(self, state: State, target: ToolTarget, branch: AnyBranch) -> Projection:
        """Return the posture on ``branch`` nearest to ``target``."""
        T = np.array(target.T)
        T[:3, :3] = self.pan(state.goal) @ T[:3, :3]
        return self._nearest(state, T, branch, lambda _q: target)

    def _nearest(
        self,
        state: State,
        T: FloatArray,
        branch: AnyBranch,
        target_at: Callable[[FloatArray], ToolTarget],
    ) -> Projection:
        """Return the posture on ``branch`` nearest to the target, which `q` (n,) may turn.

        The pose `T` (4, 4) is that of the target with axis 1 as in the goal.
        """
        projections = []
        for start in self._starts(state, T, branch):
            q = start
            for _ in range(SETTLINGS if self.chain.n < 6 else 1):
                before, q = q, self._descended(q, target_at(q), state.priority)
                if abs(q[0] - before[0]) < SETTLED:
                    break
            name = str(self.branch_of(q))
            projections.append(self._projected(q, target_at(q), name, state.priority))
        return self._best(projections, state, T, branch)

    def _best(
        self, projections: Sequence[Projection], state: State, T: FloatArray, branch: AnyBranch
    ) -> Projection:
        """Return the nearest of ``projections``, on ``branch`` if one is.

        If the limits exclude the branch for the pose `T` (4, 4), the posture is on another one, and
        its limits are those that do so.
        """
        best = min(
            projections,
            key=lambda candidate: (candidate.branch != branch, *_misses(candidate, state.priority)),
        )
        closed = self.solver.on_branch(T, branch, state.goal)
        if best.branch == branch or closed is None:
            return best
        slack = tolerances.LIMIT_SLACK
        beyond = (closed < self.chain.lower - slack) | (closed > self.chain.upper + slack)
        # Without such a limit, two branches meet in one posture, which has both names.
        axes = tuple(np.flatnonzero(beyond).tolist())
        return replace(best, limits=axes) if axes else replace(best, branch=branch)

    def _starts(self, state: State, T: FloatArray, branch: AnyBranch) -> list[FloatArray]:
        """Return postures (n,) [rad] from which the one nearest to `T` (4, 4) is searched."""
        closed = self.solver.on_branch(T, branch, state.goal)
        if closed is None:
            closed = nearest_posture(kinematics_of(self.chain), T, q_hint=state.goal).q
        starts = [self.chain.clamp(closed)]
        if branch == state.branch:
            starts.append(self.chain.clamp(state.goal))
        return starts

    def _descended(self, q: FloatArray, pose: ToolTarget, priority: Priority) -> FloatArray:
        descent = self._tracker.descent
        end = descent.run(descent.goal(pose), tuple(q.tolist()), priority, SEARCH_EFFORT)
        return np.array(end.q)

    def _seen(self, T: FloatArray, q: FloatArray) -> ToolTarget:
        """Return the pose `T` (4, 4) as a target with axis 1 as at `q` (n,) [rad]."""
        return ToolTarget(frozen(T[:3, 3]), rotation=frozen(self.pan(q).T @ T[:3, :3]))

    def losses(
        self,
        state: State,
        best: Projection,
        *,
        yaw_was_given: bool,  # noqa: ARG002
    ) -> tuple[Finding, ...]:
        """Return the findings on what ``best`` loses of its target."""
        return self._losses(best, state.priority)

    def tracking_losses(self, state: State, tracked: Tracked) -> tuple[Finding, ...]:
        """Return the findings on what following a drag loses, a gap first."""
        gap = None if tracked.beyond_gap is None else tracked.leap_ahead()
        return self._losses(tracked.best, state.priority, gap)

    def _losses(
        self, best: Projection, priority: Priority, gap: tuple[int, float] | None = None
    ) -> tuple[Finding, ...]:
        at_edge = False
        if max(best.position_error, best.rotation_error) > POSITION_WORTH_TELLING:
            descent = self._tracker.descent
            look = descent.look(descent.goal(ToolTarget.of(best.T)), tuple(best.q.tolist()))
            at_edge = look.least <= AT_EDGE
        return tuple(losses_of(self.chain, best, priority, at_edge=at_edge, gap=gap))

    def jog_twist(self, q: FloatArray, rates: FloatArray, frame: JogFrame) -> FloatArray:
        """Return the twist (6,) of rates (6,): a velocity and three rotations along ``frame``.

        The seventh rate, that of the arm angle, moves no tool.
        """
        R = self.axes(q, frame)
        return np.concatenate((R @ rates[3:6], R @ rates[:3]))

    def tool_speed(self, q: FloatArray, qd: FloatArray) -> float:
        """Return the speed of the tool point [m/s] for the rates `qd` (n,)."""
        _, moved = self._tracker.descent.search.motion(q.tolist())
        x = y = z = 0.0
        for rate, (_, _, _, vx, vy, vz) in zip(qd.tolist(), moved, strict=True):
            x, y, z = x + rate * vx, y + rate * vy, z + rate * vz
        return math.sqrt(x * x + y * y + z * z)

    def tool_speed_bound(self, qd: FloatArray) -> float:
        """Return the maximum of ``tool_speed`` over all postures."""
        return float(np.abs(qd) @ self._reaches)

    @cached_property
    def _reaches(self) -> FloatArray:
        """Bounds (n,) on the distance of the tool point from each axis [m]."""
        links = self._tracker.descent.search.links
        tool = float(np.linalg.norm(links.T_n_tool[:3, 3]))
        a, d = links.a, [*links.d, 0.0]
        # An offset along an axis does not move the tool away from it.
        lengths = [
            math.fsum(map(math.hypot, a[k:], [0.0, *d[k + 1 : len(a)]])) + tool
            for k in range(links.n)
        ]
        # A joint that slides moves the tool as fast as itself.
        return np.where(self.chain.slides, 1.0, lengths)

    def ready(self, posture: Sequence[float], T_base_shoulder: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return `ready_posture`."""
        return ready_posture(self._tracker.descent, T_base_shoulder)


def _misses(projection: Projection, priority: Priority) -> tuple[float, ...]:
    position, rotation = round(projection.position_error, 7), round(projection.rotation_error, 7)
    if priority is Priority.POSITION:
        return (position,)
    return (rotation, position) if priority is Priority.ORIENTATION else (position, rotation)


LEAST_AXES: Final = 3
"""Minimum number of axes of an arm: fewer reach no volume."""


def solved_arm(urdf: Urdf, path: Path, tool: str | None) -> OtherArm | None:
    """Return the arm with ``tool``, or any, in the description ``urdf`` of the file ``path``.

    None if there is none. Raises RobotDescriptionError if there is one, and its axes or limits are
    described wrongly.
    """
    structure = _structure(urdf, path, tool)
    return None if structure is None else _arm(urdf, path, structure)


def driven_arm(urdf: Urdf, path: Path, tool: str | None) -> OtherArm | None:
    """Return `solved_arm`; None if joints beside an arm without ``tool`` could not be driven."""
    structure = _structure(urdf, path, tool)
    if structure is None or (tool is None and any(j.mimic is None for j in structure.others)):
        return None
    return _arm(urdf, path, structure)


def _structure(urdf: Urdf, path: Path, tool: str | None) -> Structure | None:
    try:
        structure = structure_of(urdf, path, tool, count=None)
    except RobotDescriptionError:
        return None
    return structure if len(structure.axes) >= LEAST_AXES else None


def _arm(urdf: Urdf, path: Path, structure: Structure) -> OtherArm:
    described, T_base_shoulder = described_chain(urdf.frames(), structure)
    chain, notes = exact_arm(described)
    if any(chain.slides):
        tool = DrivenTool(chain)
        q = tool.ready((), T_base_shoulder)
        if equations_from(tool.solver, q).least(q) < WALL:
            raise RobotDescriptionError(
                f"The tool in {path.name} is not driven: joint {chain.names[0]!r} slides in a "
                "direction in which the turning axes move the tool already, and a freedom is "
                "missing. Drive the robot joint by joint."
            )
    kinematics = kinematics_of(chain)
    notes = (*notes, f"The kinematics are {kinematics.method}.", *kinematics.self_check)
    return OtherArm(structure, T_base_shoulder, chain, DrivenTool, notes)
