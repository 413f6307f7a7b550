"""An arm from its URDF: kinematics, plans, reachability and a view, for other programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
import numpy.typing as npt

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_files import read_robot
from katana450.assembly.robot_session import find_robot
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.driven_tool import solved_arm
from katana450.extensions.general_arms.nearest import NearestPose, nearest_pose
from katana450.extensions.importers.formats.scene_file import load_initial_scene
from katana450.extensions.programs.building.plan_state import (
    PlanContext,
    PlanState,
    UntimedPath,
)
from katana450.extensions.programs.language.kinds import ROOMIEST
from katana450.extensions.programs.language.scope import Angles, StepTarget
from katana450.extensions.programs.steps.moves import Circle, Line
from katana450.extensions.reachability.reachability import ReachabilityMap, reachability_map
from katana450.library.motion_plan import MotionPlan
from katana450.library.pose_frame import PoseFrame, dimensions
from katana450.library.solutions import IKSolutions
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, finite_array
from katana450.maths.kinematics import priority as kinematics_priority
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body, jacobian_space
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.pose import check_radians, pose_matrix
from katana450.resources import robot_file
from katana450.settings import Settings

if TYPE_CHECKING:
    from katana450.library.viewer import Viewer

Priority = Literal["pose", "pitch", "position"]

FrameName = Literal["shoulder", "base"]

PRIORITIES = {
    "pose": kinematics_priority.Priority.POSE,
    "pitch": kinematics_priority.Priority.PITCH,
    "position": kinematics_priority.Priority.POSITION,
}

FIVE_FREEDOMS: Final = 5
"""Number of freedoms of a tool that has the pitch of the plane of its arm."""

MAX_TURNS: Final = 20.0
"""Maximum number of turns of a circle."""


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm with its tool, made by `katana450.load`.

    It is immutable. Only one thread at a time may plan with it.

    Lengths are in m, angles in rad, times in s. ``T`` is a pose (4, 4): it maps coordinates of the
    tool into the frame chosen in `load`. ``q`` are the n joint angles. An argument that has the
    wrong shape, is not finite or is no rotation raises InputError. Every error of the library is a
    `katana450.KatanaError`.

    Every arm has three or more turning axes. Other joints than those of its fingers stay at zero.

    Attributes:
        robot: contents of the URDF, as the app uses it.
        session: the rules of motion: limits, collision bodies, environment.
        notes: sentences on assumptions about the file.
        pose_frame: the frame of poses and points.
        objects: objects that plans keep clear of.
    """

    robot: Robot
    session: Session
    notes: tuple[str, ...]
    pose_frame: PoseFrame
    objects: tuple[SceneObject, ...]

    @property
    def mounted(self) -> MountedArm:
        """The part of the robot that carries the tool."""
        return self.robot.require_arm()

    @property
    def name(self) -> str:
        """Name of the robot in its URDF."""
        return self.robot.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.chain.n

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the tool."""
        return self.chain.names

    @property
    def tool(self) -> str:
        """Link to which poses refer."""
        return self.mounted.default_tool

    @property
    def frame(self) -> str:
        """Frame of poses and points: "shoulder" or "base"."""
        return self.pose_frame.name

    @property
    def lower(self) -> FloatArray:
        """(n,) lower joint limits [rad]."""
        return self.chain.lower

    @property
    def upper(self) -> FloatArray:
        """(n,) upper joint limits [rad]."""
        return self.chain.upper

    @property
    def speed(self) -> FloatArray:
        """(n,) maximum joint speeds [rad/s]."""
        return self.chain.speed

    @property
    def ready(self) -> FloatArray:
        """(n,) posture with room to move [rad]; plans begin there by default."""
        return self.session.ready

    @property
    def method(self) -> str:
        """The method by which poses are solved, in words: a closed form, or numerical and why."""
        return self._kinematics.method

    @cached_property
    def chain(self) -> Chain:
        """Home configuration M, screw axes S and limits, in the frame {S}."""
        return self.mounted.chain_to(self.tool)

    @cached_property
    def _kinematics(self) -> Kinematics:
        return kinematics_of(self.chain)

    @property
    def T_base_frame(self) -> FloatArray:
        """(4, 4) maps coordinates of the frame of poses into the base [m]."""
        return self.mounted.T_base_shoulder @ se3.inverse(self.pose_frame.T_frame_shoulder)

    def __repr__(self) -> str:
        """Return a short description."""
        return f"<katana450 arm {self.name!r}, tool {self.tool!r}, poses in frame {self.frame!r}>"

    def fk(self, q: npt.ArrayLike) -> FloatArray:
        """Return the tool's pose (4, 4), or poses (N, 4, 4), at joint angles (n,) or (N, n) [rad].

        Raises InputError for another shape, NaN or infinity. Source: Lynch & Park, Modern Robotics
        (2017), ch. 4.1, the product of exponentials.

        >>> arm.fk([0.0, 0.0, 0.0, 0.0, 0.0]).shape
        (4, 4)
        >>> arm.fk(np.zeros((1000, 5))).shape
        (1000, 4, 4)
        >>> arm.fk([0.0, 0.0, 0.0])
        Traceback (most recent call last):
            ...
        katana450.errors.InputError: The joint vector has shape (3,); it must be (5,).
        """
        several = dimensions(q) == 2
        T = forward_batch(self.chain, q) if several else forward(self.chain, q)
        return self.pose_frame.from_shoulder(T)

    def ik(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> IKSolutions:
        """Return a solution for each branch of the pose (4, 4), or of poses (N, 4, 4).

        In closed form four and five axes have 4 branches, six and seven axes 8. Seven axes take the
        arm angle of each branch with the most room to the limits, or nearest to the hint. Six axes
        with an offset wrist have up to 16 postures: a single pose gets those that exist, and of
        several poses the others are NaN. A numerical solution is one posture inside the limits.

        Each solution states whether it is inside the joint limits, and its distance from the pose,
        because five axes cannot take every pose. `nearest` returns the best that the arm can do.

        Args:
            T: pose or poses of the tool [m]: an array, an `SE3`, or a pair of position (3,) and
                quaternion (w, x, y, z), or of position and roll, pitch, yaw (3,) [rad].
            q_hint: (n,) angles [rad], for a single pose. Joints with a range of more than a turn,
                and joints that the pose leaves free, are put nearest to it.

        Raises:
            InputError: another shape, NaN, a matrix that is no pose, or a pose in millimetres or
                degrees.

        Source, for five axes: the paper's eq. (12) to (29).

        >>> T = arm.fk([0.3, -1.0, 1.4, 0.3, 0.2])
        >>> for solution in arm.ik(T).feasible:
        ...     print(solution.branch, solution.q.round(3).tolist())
        front-up [0.3, -1.0, 1.4, 0.3, 0.2]
        >>> arm.ik(np.stack([T, T, T])).q.shape
        (3, 4, 5)
        >>> pose = katana450.SE3(T)
        >>> len(arm.ik((pose.position, pose.wxyz)).feasible)
        1
        """
        return IKSolutions(self._kinematics, self.pose_frame.to_shoulder(T), q_hint)

    def nearest(
        self,
        T: npt.ArrayLike,
        *,
        priority: Priority = "pose",
        branch: Branch | str | None = None,
        q_hint: npt.ArrayLike | None = None,
        within_limits: bool = True,
    ) -> NearestPose:
        """Return the feasible pose nearest to ``T`` (4, 4), with the reason for its errors.

        Args:
            T: pose of the tool [m], in any form of `ik`.
            priority: which part of the pose is kept when five axes cannot satisfy all of it.
                "pose": position, then the whole orientation. "pitch": pitch, then position, then
                roll. "position": position, then pitch, then roll. In the last two the arm
                determines the yaw. Other arms than those of five axes have "pose" alone.
            branch: "front-up", "front-down", "back-up" or "back-down" to stay on it; None for the
                one that comes nearest, the only choice of arms with other axes.
            q_hint: (n,) angles [rad]; of equally good postures the nearest to it is returned.
            within_limits: whether to keep every joint inside its limits.

        Raises:
            InputError: a pose, priority, branch or hint is invalid.

        >>> T = arm.fk(arm.ready)
        >>> T[0, 3] += 0.5
        >>> best = arm.nearest(T)
        >>> print(best.reason)
        347 mm out of reach; its links reach no farther that way
        >>> arm.nearest(arm.fk(arm.ready)).reason
        ''
        """
        if priority not in PRIORITIES:
            known = ", ".join(PRIORITIES)
            raise InputError(f"There is no priority {priority!r}; choose from {known}.")
        best = nearest_pose(
            self._kinematics,
            self.pose_frame.to_shoulder(T),
            priority=PRIORITIES[priority],
            branch=branch,
            q_hint=q_hint,
            within_limits=within_limits,
        )
        return replace(best, T=self.pose_frame.from_shoulder(best.T))

    def jacobian(self, q: npt.ArrayLike, *, body: bool = False) -> FloatArray:
        """Return the (6, n) Jacobian at joint angles ``q`` (n,) [rad].

        ``J @ qd`` is the tool's twist (omega, v) [rad/s, m/s] in the frame of poses, or in the
        tool's own frame if ``body``. Raises InputError for an invalid ``q``. Source: Lynch & Park,
        Modern Robotics (2017), ch. 5.1.

        >>> arm.jacobian(arm.ready).shape
        (6, 5)
        """
        if body:
            return jacobian_body(self.chain, q)
        return self.pose_frame.twists_from_shoulder(jacobian_space(self.chain, q))

    def plan(
        self, goal: npt.ArrayLike, start: npt.ArrayLike | None = None, *, seed: int = 0
    ) -> MotionPlan:
        """Plan a timed, collision-free motion from ``start`` to ``goal``.

        The joints follow a straight line if that is clear, else a path around the obstacles.

        Args:
            goal: (n,) joint angles [rad], or a pose of the tool in any form of `ik`.
            start: (n,) joint angles where the arm rests [rad]; None for `ready`.
            seed: seed of the random search for a path; the same seed gives the same plan.

        Raises:
            BlockedError: no clear path was found; the message names the bodies that would meet and
                the place. It is an InputError.
            InputError: the goal is outside the limits or a pose that the arm cannot take.

        >>> plan = arm.plan([1.2, -1.0, 1.4, 0.3, 0.0])
        >>> plan.end.tolist()
        [1.2, -1.0, 1.4, 0.3, 0.0]
        >>> arm.plan([0.0, 1.0, 0.0, 0.0, 0.0])
        Traceback (most recent call last):
            ...
        katana450.errors.InputError: ...
        """
        plan, goal = self._plan_from(start, seed), pose_matrix(goal)
        if dimensions(goal) == 2:
            plan = self._to_pose(plan, goal)
        else:
            plan = plan.move_to(self.chain.check_q(goal), "plan")
        if not plan.actions:
            raise InputError("The arm is at the goal already; there is nothing to plan.")
        return self._timed(plan)

    def line(
        self,
        to: npt.ArrayLike | None = None,
        *,
        by: npt.ArrayLike | None = None,
        start: npt.ArrayLike | None = None,
        pitch: float | None = None,
        roll: float | None = None,
        yaw: float | None = None,
    ) -> MotionPlan:
        """Plan a straight line of the tool point, on which the orientation changes evenly.

        Args:
            to: (3,) end of the line [m].
            by: (3,) vector from its start to its end [m], instead of ``to``. Without either the
                tool turns on the spot.
            start: (n,) joint angles where it begins [rad]; None for `ready`.
            pitch: pitch of the tool at the end [rad], positive downwards; None to keep it.
            roll: roll of the tool at the end [rad]; None to keep it.
            yaw: yaw of the tool at the end [rad], of an arm with six or more axes; None to keep it.

        Raises:
            InputError: the line leaves the arm's reach or its limits.
            BlockedError: bodies would meet; the message says where on the line, and what to do.

        >>> plan = arm.line(by=(0.05, 0.0, -0.05))
        >>> round(plan.length, 6)
        0.070711
        """
        if to is not None and by is not None:
            raise InputError("Give a line either `to`, its end, or `by`, its length and direction.")
        in_base, end = self.pose_frame.in_base, None
        if to is not None:
            position = finite_array(to, (3,), "The end of the line")
            end = StepTarget(position=position, in_base=in_base)
        vector = None if by is None else finite_array(by, (3,), "The vector `by` of the line")
        line = Line(end, vector, _checked((pitch, roll, yaw)), in_base=in_base)
        return self._timed(line.build(self._plan_from(start)))

    def circle(  # noqa: PLR0913
        self,
        centre: npt.ArrayLike,
        radius: float,
        *,
        normal: npt.ArrayLike = (1.0, 0.0, 0.0),
        pitch: float | Literal["roomiest"] | None = "roomiest",
        roll: float | None = None,
        yaw: float | None = None,
        turns: float = 1.0,
        branch: Branch | str | None = None,
        start: npt.ArrayLike | None = None,
    ) -> MotionPlan:
        """Plan a circle of the tool point, from its highest point.

        Args:
            centre: (3,) [m].
            radius: [m].
            normal: (3,) direction of its axis; of any length but 0.
            pitch: of the tool [rad]; "roomiest" keeps the joints of a five-axis arm farthest from
                their limits, None keeps the present one, as "roomiest" does for other arms.
            roll: of the tool [rad]; None keeps the present one.
            yaw: of the tool [rad], of an arm with six or more axes; None keeps the present one.
            turns: number of turns, negative for the opposite direction, at most 20.
            branch: as in `nearest`; None for the first on which the circle is possible.
            start: (n,) joint angles [rad] where the plan begins; it then leads to the circle. None
                to begin on the circle, in the posture that the arm would have after moving there
                from `ready`.

        Raises:
            InputError: the circle leaves the arm's reach or its limits.
            BlockedError: bodies would meet; the message says where on the circle.

        >>> plan = arm.circle((0.15, 0.0, -0.11), 0.1)
        >>> bool(abs(plan.length - 2.0 * np.pi * 0.1) < 1e-5)
        True
        """
        axis = finite_array(normal, (3,), "The normal of the circle")
        length = math.hypot(*axis)
        if length == 0.0:
            raise InputError("The normal of the circle is zero; give it a direction.")
        size = float(finite_array(radius, (), "The radius of the circle"))
        if size <= 0.0:
            raise InputError(f"The radius of the circle is {size:g} m; it must be above 0.")
        count = float(finite_array(turns, (), "The number of turns"))
        if not 0.0 < abs(count) <= MAX_TURNS:
            raise InputError(
                f"The number of turns is {count:g}; it must be at most {MAX_TURNS:g} and not 0."
            )
        is_roomiest = pitch == ROOMIEST
        angles = _checked((None if is_roomiest else pitch, roll, yaw))
        can_choose = self.mounted.kinematics.freedoms == FIVE_FREEDOMS
        circle = Circle(
            centre=finite_array(centre, (3,), "The centre of the circle"),
            axis=axis / length,
            pitch=ROOMIEST if is_roomiest and can_choose else angles.pitch,
            roll=angles.roll,
            yaw=angles.yaw,
            in_base=self.pose_frame.in_base,
            radius=size,
            turns=count,
            branch=branch,
        )
        plan = circle.build(self._plan_from(start))
        return self._timed(plan if start is not None else replace(plan, actions=plan.actions[-1:]))

    def reachability(
        self,
        voxel: float | None = None,
        *,
        table: float = 0.0,
    ) -> ReachabilityMap:
        """Map where the tool can be, and which fraction of orientations it can have there.

        The map respects joint limits and keeps elbow, wrist and tool point above the table. It
        ignores collisions. It takes seconds to minutes.

        Args:
            voxel: edge of a voxel [m]; half the edge takes eight times as long. None for what suits
                the arm.
            table: height of the table in the base frame [m].

        Returns:
            a map with ``points`` (N, 3) [m], always in the base frame, and ``fraction`` (N,), the
            fraction of orientations; of arms without a closed form, and of fewer than five axes, 1.

        Raises InputError for invalid numbers, and for a map that would take too long.

        >>> map = arm.reachability(0.2)
        >>> bool((map.fraction > 0.0).all() and (map.fraction <= 1.0).all())
        True
        """
        return reachability_map(self.chain, self.mounted.T_base_shoulder, table, voxel)

    def show(
        self,
        what: MotionPlan | npt.ArrayLike | None = None,
        *,
        port: int = 8090,
        host: str = "127.0.0.1",
    ) -> Viewer:
        """Open a 3D scene of the arm for a browser; in a notebook it is shown below the cell.

        The scene is open until the viewer is closed or the program ends; ``arm.show(plan).wait()``
        keeps a script from ending.

        Args:
            what: a plan to show repeatedly, or joint angles (n,) [rad]; None for `ready`.
            port: TCP port of the scene, or the next free one above it.
            host: address to listen on. There is no password: use only this machine, unless you
                trust the network.

        Raises:
            ConfigurationError: no port could be opened.

        >>> with arm.show([0.3, -1.0, 1.4, 0.3, 0.0]) as viewer:
        ...     viewer.url.startswith("http://127.0.0.1:")
        True
        """
        from katana450.library.viewer import Viewer

        if what is not None and not isinstance(what, MotionPlan):
            self.chain.check_q(what)
        parts = self.robot, self.session, self.standing, self.T_base_frame
        viewer = Viewer(*parts, port, host)
        if isinstance(what, MotionPlan):
            viewer.play(what)
        elif what is not None:
            viewer.move(what)
        return viewer

    def standing(self, q: npt.ArrayLike) -> State:
        """Return the state of the arm at rest at ``q`` (n,) [rad], with its objects.

        Raises InputError if ``q`` is not n finite angles.
        """
        gripper = self.session.require_arm().gripper.clamp(0.0)
        state = self.session.begin(self.chain.check_q(q), gripper, 0.0)
        return replace(state, objects=self.objects)

    def _plan_from(self, start: npt.ArrayLike | None, seed: int = 0) -> PlanState:
        """Return a plan without steps that begins at ``start`` (n,) [rad]; None for `ready`."""
        plan_context = PlanContext(self.session, self.mounted.T_base_shoulder, seed)
        return PlanState(plan_context, self.standing(self.ready if start is None else start))

    def _to_pose(self, plan: PlanState, goal: npt.ArrayLike) -> PlanState:
        """Plan to the nearest reachable posture that takes the pose ``goal`` (4, 4)."""
        q = plan.q
        solutions = self.ik(goal, q).feasible
        if not solutions:
            why = self.nearest(goal, q_hint=q).reason or "only the nearest pose is"
            raise InputError(
                f"The arm cannot take this pose: {why}. `Arm.nearest` returns the nearest feasible "
                "pose."
            )
        nearest_first = sorted(solutions, key=lambda solution: float(np.abs(solution.q - q).max()))
        return plan.first(nearest_first, lambda plan, posture: plan.move_to(posture.q, "plan"))

    def _timed(self, plan: PlanState) -> MotionPlan:
        """Time the paths of ``plan``, one after another."""
        untimed_paths = [action for _, action in plan.actions if isinstance(action, UntimedPath)]
        paths = tuple(path for untimed in untimed_paths for path in untimed.paths)
        timed = replace(untimed_paths[0], paths=paths).timed().plan
        return MotionPlan(timed, self.chain, self.pose_frame)


def load(
    urdf: str | Path | None = None,
    tool: str | None = None,
    *,
    frame: FrameName = "shoulder",
    scene: str | Path | None = None,
) -> Arm:
    """Load an arm from a URDF file.

    Its poses are solved in closed form for the arms listed in docs/library.md, else numerically;
    ``method`` of the arm says which.

    Args:
        urdf: the file, or "so101"; None for the Katana450.
        tool: link to which poses refer; None for the default (``tcp`` for the Katana450).
        frame: coordinates of all poses and points: "shoulder", the paper's frame {S} where axes 1
            and 2 cross, parallel to the base; or "base", the root link of the URDF.
        scene: YAML file of further obstacles for plans, beside the arm itself and the table
            (docs/scenes.md); None for those of the app, a cup and a basin.

    Raises:
        RobotDescriptionError: the file cannot be read or has no arm of three or more turning axes.
        InputError: the frame is unknown or the scene is invalid; the message says what to do.

    >>> arm = katana450.load()
    >>> arm.name, arm.tool, arm.n
    ('katana450', 'tcp', 5)
    >>> katana450.load(tool="hand")
    Traceback (most recent call last):
        ...
    katana450.errors.RobotDescriptionError: ...
    """
    path = robot_file(urdf)
    scene_path = None if scene is None else Path(scene)
    robot, session, notes = find_robot(Settings(), path, tool)
    if robot.arm is None:
        # Beside the arm are joints that a server would drive one by one.
        tool = read_robot(path, None, solved_arm).require_arm().default_tool
        robot, session, notes = find_robot(Settings(), path, tool)
    return Arm(
        robot=robot,
        session=session,
        notes=notes,
        pose_frame=PoseFrame.of(robot.require_arm().T_base_shoulder, frame),
        objects=load_initial_scene(session, scene_path).scene.objects,
    )


def _checked(angles: Sequence[float | str | None]) -> Angles:
    """Return pitch, roll and yaw as floats. Raises InputError, which names a wrong one."""
    checked = Angles(*map(_angle, angles, Angles._fields))
    check_radians((angle for angle in checked if angle is not None), "The orientation")
    return checked


def _angle(value: float | str | None, name: str) -> float | None:
    if isinstance(value, str):
        raise InputError(f"The {name} is {value!r}; give an angle in rad.")
    return None if value is None else float(finite_array(value, (), f"The {name}"))
