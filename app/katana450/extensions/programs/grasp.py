"""The program step ``grasp``: plan how the fingers take an object where it stands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.scene_objects import SceneObject
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.actions import MoveFingers, UseTool
from katana450.extensions.programs.carry import APPROACHES, before
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.plan_builder import GraspInfo, PlanBuilder
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.curve import ToolLine
from katana450.maths.planning.plan import JOIN_TOLERANCE, MARGIN

PITCHES = tuple(np.radians((30.0, 35.0, 25.0, 40.0, 20.0, 45.0)).tolist())
"""[rad] Pitches of the tool for a grasp, tried in this order. The arm pours better with a smaller
pitch, but the limit of the shoulder joint keeps a level tool (pitch 0) above 110 mm.
"""

GRASP_HEIGHT_FRACTION = 0.78
"""[1] Height of the grasp as a fraction of the object's height. Above the middle of the object, the
palm has room over the table.
"""

MIN_DISTANCE, MAX_DISTANCE, DISTANCE_STEP = 0.0, 0.03, 0.002
"""[m] Minimum, maximum and step of the distance between the tool frame and the object's axis."""

PALM_CLEARANCE = MARGIN + 5e-4
"""[m] Minimum distance between the palm and the grasped object."""


@dataclass(frozen=True)
class Grasp:
    """Grasp an object: open the fingers, approach from the front, close until both fingers touch.

    Attributes:
        name: name of the object.
        pitch: of the tool [rad]; None for the first of PITCHES with which this and all later steps
            succeed.
        height: above the underside of the object [m]; None for GRASP_HEIGHT_FRACTION of its height.
    """

    name: str
    pitch: float | None
    height: float | None

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the name of an object, or {object, pitch, height}. Raises ScriptError."""
        if value.kind == "text":
            return cls(read.text(value), None, None)
        fields = Fields(value, "a grasp")
        found = cls(
            fields.need("object", read.text, ""),
            fields.take("pitch", read.degrees(0.0, 90.0), None),
            fields.take("height", read.millimetres(1.0, 500.0), None),
        )
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Plan the grasp. Raises InputError if the object cannot be taken."""
        scene_object = builder.scene_object(self.name)
        if builder.state.grip is not None:
            raise InputError("The hand already holds an object. Set it down first.")
        if not scene_object.can_be_held:
            raise InputError(
                f"{self.name} cannot be held by the fingers. Set its `can_be_held` to true if they "
                "may take it."
            )
        if builder.state.tool != "grasp":
            builder.plan_context.arm.chain_to("grasp")
            builder.note("tool grasp", UseTool("grasp"), replace(builder.state, tool="grasp"))
        opened = builder.plan_context.arm.gripper.upper
        builder.note("open", MoveFingers(opened), builder.after(cmd.SetGripper(opened)))
        remaining = [pitch for pitch in PITCHES if pitch not in builder.given_up]
        try:
            builder.first(
                remaining if self.pitch is None else [self.pitch],
                lambda pitch: self._plan(builder, scene_object, pitch),
            )
        except InputError as error:
            raise InputError(f"{self.name} cannot be grasped at its place: {error}") from error

    def _plan(self, builder: PlanBuilder, scene_object: SceneObject, pitch: float) -> None:
        """Plan approach and closing at ``pitch`` [rad]. Raises InputError if it is not possible."""
        height = GRASP_HEIGHT_FRACTION * scene_object.height if self.height is None else self.height
        point = builder.point(scene_object.T[:3, 3] + (0.0, 0.0, height), in_base=True)
        distance, q = _smallest_distance(builder, point, pitch)
        start = builder.first(
            APPROACHES, lambda away: _joints_before(builder, point, pitch, distance + away)
        )
        builder.move_to(start, f"grasp {self.name}: approach")
        builder.lead([ToolLine(builder.at, before(point, pitch, distance))], f"grasp {self.name}")
        if float(np.abs(builder.q - q).max()) > JOIN_TOLERANCE:
            raise InputError("the straight path to it ends in another posture than planned.")
        closed = builder.plan_context.arm.gripper.lower
        held = builder.after(cmd.SetGripper(closed))
        if held.grip is None:
            reasons = ", ".join(finding.reason.value for finding in held.findings)
            raise InputError(
                f"the fingers do not hold it ({reasons or 'they close without touching it'})."
            )
        builder.note(f"grasp {self.name}: close", MoveFingers(closed), held)
        builder.taken = GraspInfo(builder.at, pitch if self.pitch is None else None)


def _joints_before(
    builder: PlanBuilder, point: FloatArray, pitch: float, distance: float
) -> FloatArray:
    """Return the joints (5,) [rad] with the tool ``distance`` [m] before ``point`` (3,) [m]."""
    return builder.joints_of(before(point, pitch, distance))


def _smallest_distance(
    builder: PlanBuilder, point: FloatArray, pitch: float
) -> tuple[float, FloatArray]:
    """Return the smallest distance [m] of the tool before ``point`` at which the palm has room.

    The second value is the joints (5,) [rad] at that distance.
    """

    def joints_with_room(distance: float) -> tuple[float, FloatArray]:
        q = _joints_before(builder, point, pitch, distance)
        nearest = None if world is None else world.nearest(np.append(q, fingers))
        if nearest is not None and nearest.distance < PALM_CLEARANCE:
            one, other = nearest.parts
            raise InputError(
                f"{one} and {other} would be {1e3 * nearest.distance:.1f} mm apart; the minimum is "
                f"{1e3 * PALM_CLEARANCE:.1f} mm."
            )
        return distance, q

    world, fingers = builder.world, builder.state.gripper_setpoint
    distances = np.arange(MIN_DISTANCE, MAX_DISTANCE + DISTANCE_STEP, DISTANCE_STEP).tolist()
    return builder.first(distances, joints_with_room)


STEPS: dict[str, type[Step]] = {"grasp": Grasp}
"""Program steps of this module, by their names in a script."""
