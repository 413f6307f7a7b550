"""The step ``grasp``: take an object between the fingers, planned from its place."""

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
"""[rad] Pitches of a grasp, tried in this order. Flatter ones pour better, but the shoulder's limit
keeps a level tool above 110 mm.
"""

GRASP_HEIGHT_FRACTION = 0.78
"""[1] Fraction of an object's height: above the middle, where the palm has room over the table."""

SHORTEST, LONGEST_BACK, STEP = 0.0, 0.03, 0.002
"""[m] Range and step of the distance of the tool frame before the object's axis."""

PALM_CLEARANCE = MARGIN + 5e-4
"""[m] Minimum distance between the palm and the grasped object."""


@dataclass(frozen=True)
class Grasp:
    """Grasp an object: open the fingers, approach from the front, close until both fingers touch.

    Attributes:
        name: name of the object.
        pitch: [rad]; None for the first of PITCHES with which this and later steps succeed.
        height: [m] above the object's foot; None for GRASP_HEIGHT_FRACTION of its height.
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
            raise InputError("The hand already holds an object: set it down first.")
        if not scene_object.can_be_held:
            raise InputError(f"{self.name} cannot be held by the fingers.")
        if builder.state.tool != "grasp":
            builder.plan_context.arm.chain_to("grasp")
            builder.note("tool grasp", UseTool("grasp"), replace(builder.state, tool="grasp"))
        opened = builder.plan_context.arm.gripper.upper
        builder.note("open", MoveFingers(opened), builder.after(cmd.SetGripper(opened)))
        free = [pitch for pitch in PITCHES if pitch not in builder.given_up]
        try:
            builder.first(
                free if self.pitch is None else [self.pitch],
                lambda pitch: self._take(builder, scene_object, pitch),
            )
        except InputError as error:
            raise InputError(f"{self.name} cannot be grasped at its place: {error}") from error

    def _take(self, builder: PlanBuilder, scene_object: SceneObject, pitch: float) -> None:
        height = GRASP_HEIGHT_FRACTION * scene_object.height if self.height is None else self.height
        middle = builder.point(scene_object.T[:3, 3] + (0.0, 0.0, height), in_base=True)
        back, q = _nearest(builder, middle, pitch)
        start = builder.first(APPROACHES, lambda away: _there(builder, middle, pitch, back + away))
        builder.move_to(start, f"grasp {self.name}: approach")
        builder.lead([ToolLine(builder.at, before(middle, pitch, back))], f"grasp {self.name}")
        if float(np.abs(builder.q - q).max()) > JOIN_TOLERANCE:
            raise InputError("the straight path to it ends in another posture.")
        closed = builder.plan_context.arm.gripper.lower
        held = builder.after(cmd.SetGripper(closed))
        if held.grip is None:
            reasons = ", ".join(finding.reason.value for finding in held.findings)
            raise InputError(f"the fingers do not hold it ({reasons or 'they pass it'}).")
        builder.note(f"grasp {self.name}: close", MoveFingers(closed), held)
        builder.taken = GraspInfo(builder.at, pitch if self.pitch is None else None)


def _there(builder: PlanBuilder, middle: FloatArray, pitch: float, back: float) -> FloatArray:
    """Return the joints (5,) [rad] with the tool ``back`` [m] before ``middle`` (3,) [m]."""
    return builder.joints_of(before(middle, pitch, back))


def _nearest(builder: PlanBuilder, middle: FloatArray, pitch: float) -> tuple[float, FloatArray]:
    """Return the smallest distance [m] before ``middle`` with room for the palm, and its joints."""

    def roomy(back: float) -> tuple[float, FloatArray]:
        q = _there(builder, middle, pitch, back)
        met = None if world is None else world.nearest(np.append(q, fingers))
        if met is not None and met.distance < PALM_CLEARANCE:
            one, other = met.parts
            raise InputError(f"{one} and {other} would be {1e3 * met.distance:.1f} mm apart.")
        return back, q

    world, fingers = builder.world, builder.state.gripper_setpoint
    return builder.first(np.arange(SHORTEST, LONGEST_BACK + STEP, STEP).tolist(), roomy)


STEPS: dict[str, type[Step]] = {"grasp": Grasp}
"""Steps of this module, by their names in a script."""
