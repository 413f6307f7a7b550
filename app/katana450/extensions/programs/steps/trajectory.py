"""The step ``trajectory``: postures at given times, as a recording or another program has them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from katana450.arm.control.session.session import TOOL_SPEED
from katana450.errors import BlockedError, InputError
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.building.plan_state import (
    CARRY,
    PlanState,
    UntimedPath,
    require_turning,
)
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.declaration import Kind
from katana450.extensions.programs.language.kinds import (
    LEAST_JOINTS,
    MAX_ANGLE,
    MAX_JOINTS,
    defined,
    degrees,
    list_of,
    listed,
    number,
)
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import YamlValue
from katana450.extensions.programs.planning.trajectory_path import TrajectoryPath, recorded_scaling
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.clearance import Sweep, SweptClearance
from katana450.maths.planning.plan import apart
from katana450.maths.planning.plan import plan as timed_plan
from katana450.maths.planning.scaling import Bounds

CLEARANCE = MIN_CLEARANCE - 2e-4
"""[m] Distance that a trajectory keeps. A moving arm keeps MIN_CLEARANCE by itself, and the spline
through its recorded setpoints may pass a little nearer."""

MAX_POSTURES = 1200
"""Maximum number of postures of one step; the script's own size bounds their sum."""

MAX_TIME = 24 * 3600.0
"""[s] Maximum time of a posture."""

TRAJECTORY = "trajectory"


@dataclass(frozen=True, eq=False)
class UntimedTrajectory(UntimedPath):
    """A trajectory that is checked for contacts; it gets its own times, or slower ones."""

    def timed(self) -> FollowPlan:
        """Return the timed plan, with limited tool acceleration if an object is held."""
        gentle = None if self.state.grip is None else CARRY
        bounds = Bounds(self.arm.limits, TOOL_SPEED, gentle)
        fingers = self.state.gripper_setpoint
        timed = timed_plan(
            self.paths, bounds, self.world, fingers, CLEARANCE, timing=recorded_scaling
        )
        (path,) = self.paths
        assert isinstance(path, TrajectoryPath)
        note = path.slowing(timed.duration, bounds.joints.speed)
        return FollowPlan(timed, note=note)


TIME = number(0.0, MAX_TIME, "s")
JOINT = degrees(-MAX_ANGLE, MAX_ANGLE)


def _row(value: YamlValue, _context: ScriptContext) -> tuple[float, ...]:
    """Read a time [s] and the angles of all joints [deg]; the angles are returned in rad."""
    if value.kind != "list" or not LEAST_JOINTS <= len(value.items) - 1 <= MAX_JOINTS:
        raise value.wrong(
            "Expected a time and the angles of all joints, such as [0.5, 0, -65, 85, 8, 0]."
        )
    time, *angles = value.items
    return TIME(time), *map(JOINT, angles)


POSTURE = defined(
    "posture",
    Kind(
        _row,
        list_of(
            number(-MAX_TIME, MAX_TIME, about="A time, s, then the angles, deg").schema,
            1 + LEAST_JOINTS,
            1 + MAX_JOINTS,
        ),
    ),
)
POSTURES = listed(POSTURE, 2, MAX_POSTURES)


def _rows(value: YamlValue, _context: ScriptContext) -> FloatArray:
    """Read rows of one length."""
    rows = POSTURES(value)
    joints = len(rows[0]) - 1
    for item, row in zip(value.items, rows, strict=True):
        if len(row) != 1 + joints:
            raise item.wrong(f"Expected a time and {joints} angles, as in the first row.")
    return np.array(rows)


@dataclass(frozen=True, eq=False)
class FollowTrajectory(Step, word="trajectory"):
    """Move through postures at given times, on a smooth path, slower where limits require it.

    The arm first moves to the first posture, on any path round obstacles.

    Attributes:
        through: (m, 1 + n) rows of a time [s], from any zero, and a posture [rad].
    """

    through: Annotated[
        FloatArray, Kind(_rows, POSTURES.schema).about("Rows of a time, s, and all angles, deg")
    ]

    def build(self, plan: PlanState) -> PlanState:
        """Plan the way to the start, and the trajectory.

        Raises BlockedError with the time at which two parts would meet, and InputError for a
        posture beyond the limits, or of another number of joints.
        """
        require_turning(plan.chain)
        times, postures = frozen(self.through[:, 0]), frozen(self.through[:, 1:])
        joints, columns = plan.chain.n, postures.shape[1]
        if columns != joints:
            raise InputError(f"The arm has {joints} joints; a row of this has {columns} angles.")
        path = TrajectoryPath(plan.chain, times, postures)
        plan = plan.move_to(path.start, f"{TRAJECTORY}: approach")
        _check_clear(plan, path)
        arm, world = plan.plan_context.arm, plan.world
        untimed = UntimedTrajectory(arm, world, plan.state, (path,))
        return plan.with_action(TRAJECTORY, untimed, plan.standing(path.end).state)


def _check_clear(plan: PlanState, path: TrajectoryPath) -> None:
    """Raise BlockedError, with the time, unless all of ``path`` keeps CLEARANCE from everything."""
    world, fingers = plan.world, plan.state.gripper_setpoint
    if world is None:
        return
    sweep = Sweep(path)
    room = SweptClearance.about(world, CLEARANCE, sweep.at(0.0, fingers), sweep.at(1.0, fingers))
    nearest = sweep.blocked(room, fingers)
    if nearest is None:
        return
    x = sweep.at(nearest.sigma, fingers)
    worst = room.worst(x)
    raise BlockedError(
        f"At {path.time(nearest.sigma):.2f} s of the trajectory, with the tool at {{point}}, "
        f"{{parts}} would {apart(worst.distance)}, and {1e3 * CLEARANCE:g} mm are required. "
        "Move the obstacle, or leave this part out.",
        forward(path.chain, x[: path.chain.n])[:3, 3].tolist(),
        parts=worst.parts,
    )
