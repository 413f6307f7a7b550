"""Planning for the library: it builds the steps of scripts, from a posture at rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.general_arms.nearest import nearest_pose
from katana450.extensions.programs.building.plan_state import (
    PlanContext,
    PlanState,
    UntimedPath,
)
from katana450.extensions.programs.language.places import ROOMIEST
from katana450.extensions.programs.language.step_target import Angles, StepTarget
from katana450.extensions.programs.steps.tool_moves import Circle, Line
from katana450.library.pose_frame import PoseFrame, dimensions
from katana450.library.solutions import IKSolutions
from katana450.maths.geometry.arrays import FloatArray, finite_array, real_array
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.pose_units import check_radians
from katana450.maths.planning.plan import Plan

MAX_TURNS = 20.0


@dataclass(frozen=True, eq=False)
class Planner:
    """Makes plans in coordinates of ``frame``; see `katana450.Arm`.

    Attributes:
        kinematics: those of the tool.
        session: the rules of motion.
        T_base_shoulder: (4, 4) frame {S} in the base [m].
        frame: frame of poses and points.
        objects: objects that plans keep clear of.
    """

    kinematics: Kinematics
    session: Session
    T_base_shoulder: FloatArray
    frame: PoseFrame
    objects: tuple[SceneObject, ...]

    def standing(self, q: npt.ArrayLike) -> State:
        """Return the state of the arm at rest at ``q`` (n,) [rad], with its objects."""
        angles = self.kinematics.chain.check_q(q)
        gripper = self.session.require_arm().gripper.clamp(0.0)
        return replace(self.session.begin(angles, gripper, 0.0), objects=self.objects)

    def to(self, goal: npt.ArrayLike, start: npt.ArrayLike | None, seed: int) -> Plan:
        """Plan to ``goal``: joint angles (n,) [rad] or a pose (4, 4)."""
        plan = self._plan(start, seed)
        if dimensions(goal) == 2:
            plan = self._to_pose(plan, goal)
        else:
            plan = plan.move_to(self.kinematics.chain.check_q(goal), "plan")
        if not plan.actions:
            raise InputError("The arm is at the goal already; there is nothing to plan.")
        return _timed(plan)

    def line(
        self,
        to: npt.ArrayLike | None,
        by: npt.ArrayLike | None,
        start: npt.ArrayLike | None,
        angles: Sequence[float | str | None],
    ) -> Plan:
        """Plan a straight line of the tool point."""
        if to is not None and by is not None:
            raise InputError("Give a line either `to`, its end, or `by`, its length and direction.")
        in_base, end = self.frame.in_base, None
        if to is not None:
            position = finite_array(to, (3,), "The end of the line")
            end = StepTarget(position=position, in_base=in_base)
        step = Line(
            end,
            None if by is None else finite_array(by, (3,), "The vector `by` of the line"),
            _checked(angles),
            in_base=in_base,
        )
        return _timed(step.build(self._plan(start)))

    def circle(
        self,
        centre: npt.ArrayLike,
        radius: float,
        normal: npt.ArrayLike,
        start: npt.ArrayLike | None,
        angles: Sequence[float | str | None],
        turns: float,
        branch: AnyBranch | None,
    ) -> Plan:
        """Plan a circle of the tool point, with the path to it from ``start``, if given."""
        axis = finite_array(normal, (3,), "The normal of the circle")
        length = math.hypot(*axis)
        if length == 0.0:
            raise InputError("The normal of the circle is zero; give it a direction.")
        size = _number(radius, "The radius of the circle")
        if size <= 0.0:
            raise InputError(f"The radius of the circle is {size:g} m; it must be above 0.")
        count = _number(turns, "The number of turns")
        if not 0.0 < abs(count) <= MAX_TURNS:
            raise InputError(
                f"The number of turns is {count:g}; it must be at most {MAX_TURNS:g} and not 0."
            )
        is_roomiest = angles[0] == ROOMIEST
        pitch, roll, yaw = _checked((None, *angles[1:]) if is_roomiest else angles)
        circle = Circle(
            centre=finite_array(centre, (3,), "The centre of the circle"),
            axis=axis / length,
            pitch=ROOMIEST if is_roomiest else pitch,
            roll=roll,
            yaw=yaw,
            in_base=self.frame.in_base,
            radius=size,
            turns=count,
            branch=branch,
        )
        plan = circle.build(self._plan(start))
        return _timed(plan if start is not None else replace(plan, actions=plan.actions[-1:]))

    def _to_pose(self, plan: PlanState, goal: npt.ArrayLike) -> PlanState:
        """Plan to the nearest reachable posture that takes the pose ``goal`` (4, 4)."""
        T = self.frame.to_shoulder(goal)
        solutions = IKSolutions(self.kinematics, T, plan.q).feasible
        if not solutions:
            nearest = nearest_pose(self.kinematics, T, q_hint=plan.q)
            why = nearest.reason or "only the nearest pose is"
            raise InputError(
                f"The arm cannot take this pose: {why}. `Arm.nearest` returns the nearest feasible "
                "pose."
            )
        q = plan.q
        nearest_first = sorted(solutions, key=lambda solution: float(np.abs(solution.q - q).max()))
        return plan.first(nearest_first, lambda plan, posture: plan.move_to(posture.q, "plan"))

    def _plan(self, start: npt.ArrayLike | None, seed: int = 0) -> PlanState:
        plan_context = PlanContext(self.session, self.T_base_shoulder, seed)
        return PlanState(
            plan_context, self.standing(self.session.ready if start is None else start)
        )


def _timed(plan: PlanState) -> Plan:
    """Time the paths of ``plan``, one after another."""
    untimed_paths = [action for _, action in plan.actions if isinstance(action, UntimedPath)]
    paths = tuple(path for untimed in untimed_paths for path in untimed.paths)
    return replace(untimed_paths[0], paths=paths).timed().plan


def _number(value: float, name: str) -> float:
    """Return ``value`` as a float. Raises InputError, whose message names it ``name``."""
    number = float(real_array(value, (), name))
    if not math.isfinite(number):
        raise InputError(f"{name} is {number}; give a finite number.")
    return number


def _checked(angles: Sequence[float | str | None]) -> Angles:
    """Return pitch, roll and yaw as floats. Raises InputError, which names a wrong one."""
    checked = Angles(*map(_angle, angles, Angles._fields))
    check_radians((angle for angle in checked if angle is not None), "The orientation")
    return checked


def _angle(value: float | str | None, name: str) -> float | None:
    if isinstance(value, str):
        raise InputError(f"The {name} is {value!r}; give an angle in rad.")
    return None if value is None else _number(value, f"The {name}")
