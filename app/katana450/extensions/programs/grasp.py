"""The program step ``grasp``: plan how the fingers take an object where it stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.messages import part
from katana450.arm.control.pouring import CUP
from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.arm.control.state import Reason, State
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.actions import MoveFingers, UseTool
from katana450.extensions.programs.carry import APPROACHES, before
from katana450.extensions.programs.conditions import Held
from katana450.extensions.programs.curve import ToolLine
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.located_step import Conditional
from katana450.extensions.programs.plan_builder import Approach, GraspInfo, PlanBuilder
from katana450.extensions.programs.reaching import reaching
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step
from katana450.maths.collision.contact import Contact
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.turns import wrapped
from katana450.maths.planning.plan import JOIN_TOLERANCE, MARGIN

PITCHES = tuple(np.radians((30.0, 35.0, 25.0, 40.0, 20.0, 45.0)).tolist())
"""[rad] Pitches of the tool for a grasp from the front, tried in this order. The arm pours better
with a smaller pitch, but the limit of the shoulder joint keeps a level tool (pitch 0) above 110 mm.
"""

STEEP_PITCHES = tuple(np.radians((55.0, 65.0, 75.0)).tolist())
"""[rad] Further pitches for objects that are not poured, as near the arm only these are reached."""

DOWN = 0.5 * math.pi
"""[rad] Pitch of the tool for a grasp from above."""

FRONT, ABOVE = "front", "above"
"""The sides from which an object is grasped."""

HEIGHT_FRACTIONS = {FRONT: (0.78, 0.95), ABOVE: (0.5, 0.7, 0.9, 1.05, 1.2)}
"""[1] Heights of the grasp as fractions of the object's height, tried in this order. From the front
the palm has room over the table only above the middle of the object.
"""

LOW = 0.045
"""[m] Height below which an object is also grasped by the fingertips."""

MIN_HEIGHT = 0.012
"""[m] Minimum height of an object: the tips stay MARGIN over what it stands on, at most a step of
TIP_DISTANCES more, and cover at least 4 mm of it.
"""

TIP_DISTANCES = tuple(np.arange(0.014, 0.056, 0.002).tolist())
"""[m] Distances between the tool frame and the middle of an object that is grasped by the tips,
tried from the smallest. The tips move down as the fingers close.
"""

MAX_SKEW = math.radians(15.0)
"""[rad] Maximum angle between the fingers and the sides of a box: the pads yield by as much."""

MAX_DISTANCE, DISTANCE_STEP = 0.03, 0.002
"""[m] How far the tool moves away from an object, at most and by which steps, until the palm has
room.
"""

PALM_CLEARANCE = MARGIN + 5e-4
"""[m] Minimum distance between the palm and the grasped object."""

JOINT_ROOM = math.radians(2.0)
"""[rad] Distance to the joint limits that a grasp keeps, if one of its pitches can."""


class Grip(NamedTuple):
    """The place of a grasp on an object.

    Attributes:
        height: over the underside of the object [m].
        distance: between the tool frame and the axis of the object there [m], at least.
    """

    height: float
    distance: float = 0.0


@dataclass(frozen=True)
class Grasp:
    """Grasp an object: open the fingers, approach it, close until both fingers touch.

    Attributes:
        name: name of the object.
        side: FRONT or ABOVE; "" for the first with which this and all later steps succeed.
        pitch: of the tool [rad]; None for the first with which this and all later steps succeed.
        height: above the underside of the object [m]; None for HEIGHT_FRACTIONS of its height.
    """

    name: str
    side: str = ""
    pitch: float | None = None
    height: float | None = None

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the name of an object, or {object, side, pitch, height}. Raises ScriptError."""
        if value.kind == "text":
            return cls(read.text(value))
        fields = Fields(value, "a grasp")
        found = cls(
            fields.need("object", read.text, ""),
            fields.take("side", read.choice(FRONT, ABOVE), ""),
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
        if self.height is None and scene_object.height < MIN_HEIGHT:
            raise InputError(
                f"{self.name} is {1e3 * scene_object.height:.1f} mm high, and the minimum is "
                f"{1e3 * MIN_HEIGHT:.0f} mm: the fingertips stay {1e3 * MARGIN:.0f} mm over what "
                "an object stands on."
            )
        if builder.state.tool != "grasp":
            builder.plan_context.arm.chain_to("grasp")
            builder.note("tool grasp", UseTool("grasp"), replace(builder.state, tool="grasp"))
        opened = builder.plan_context.arm.gripper.upper
        builder.note("open", MoveFingers(opened), builder.after(cmd.SetGripper(opened)))
        branch_of, ready = builder.plan_context.arm.kinematics.branch_of, builder.plan_context.ready
        # Pitches of a grasp are those of the posture at Home; an arm that reaches over its shoulder
        # would take the object with the hand upside down.
        via_home = (False,) if branch_of(builder.q) == branch_of(ready) else (False, True)

        def take(via: bool) -> None:
            if via:
                builder.move_to(ready, f"grasp {self.name}: home")
            self._approach(builder, scene_object)

        try:
            builder.first(via_home, take)
        except InputError as error:
            raise InputError(f"{self.name} cannot be grasped at its place: {error}") from error

    def _approach(self, builder: PlanBuilder, scene_object: SceneObject) -> None:
        """Plan the grasp with the first approach that works. Raises InputError without one."""
        chosen = self._approaches(builder, scene_object)
        try:
            builder.first(chosen, lambda it: self._plan(builder, scene_object, it, JOINT_ROOM))
        except InputError:
            builder.first(chosen, lambda it: self._plan(builder, scene_object, it, 0.0))

    def _approaches(self, builder: PlanBuilder, scene_object: SceneObject) -> list[Approach]:
        """Return the approaches to try, in their order, without those that were given up."""
        if self.pitch is not None:
            return [Approach(self.pitch)]
        found = approaches(builder, scene_object)
        sides = [self.side] if self.side else list(found)
        chosen = [each for side in sides for each in found.get(side, ())]
        if not chosen:
            raise InputError(_no_approach(scene_object, self.side))
        remaining = [each for each in chosen if each not in builder.given_up]
        # Without one in reach, the first gives the reason.
        in_reach = [each for each in remaining if self._is_in_reach(builder, scene_object, each)]
        return in_reach or remaining[:1]

    def _is_in_reach(
        self, builder: PlanBuilder, scene_object: SceneObject, approach: Approach
    ) -> bool:
        """Return whether the tool can be at one of the heights of a grasp."""
        return any(
            reaching(
                builder.chain,
                builder.q,
                before(_point(builder, scene_object, each.height), approach, each.distance),
                None,
            )
            is not None
            for each in self._grips(scene_object, approach)
        )

    def _grips(self, scene_object: SceneObject, approach: Approach) -> list[Grip]:
        """Return the places of the grasp on the object, the best first."""
        if self.height is not None:
            return [Grip(self.height)]
        fractions = HEIGHT_FRACTIONS[ABOVE if approach.pitch == DOWN else FRONT]
        found = [Grip(fraction * scene_object.height) for fraction in fractions]
        if scene_object.height < LOW:
            found += [Grip(0.5 * scene_object.height, each) for each in TIP_DISTANCES]
        return found

    def _plan(
        self, builder: PlanBuilder, scene_object: SceneObject, approach: Approach, room: float
    ) -> None:
        """Plan approach and closing, ``room`` [rad] from the joint limits.

        Raises InputError if it is not possible.
        """
        builder.first(
            self._grips(scene_object, approach),
            lambda grip: self._plan_at(builder, scene_object, approach, grip, room),
        )

    def _plan_at(
        self,
        builder: PlanBuilder,
        scene_object: SceneObject,
        approach: Approach,
        grip: Grip,
        room: float,
    ) -> None:
        """Plan the grasp at ``grip``. Raises InputError if it is not possible."""
        point = _point(builder, scene_object, grip.height)
        distance, q = _smallest_distance(builder, point, approach, grip.distance)
        # Before the path there, whose planning takes longer.
        self._closed(builder, q)

        def start_at(away: float) -> FloatArray:
            start = builder.joints_of(before(point, approach, distance + away))
            left = min(_joint_room(builder, start), _joint_room(builder, q))
            if left < room:
                raise InputError(f"a joint would come within {math.degrees(left):.1f} deg.")
            return start

        start = builder.first(APPROACHES, start_at)
        builder.move_to(start, f"grasp {self.name}: approach")
        goal = before(point, approach, distance)
        builder.lead([ToolLine(builder.at, goal)], f"grasp {self.name}")
        if float(np.abs(builder.q - q).max()) > JOIN_TOLERANCE:
            raise InputError("the straight path to it ends in another posture than planned.")
        closed, held = builder.plan_context.arm.gripper.lower, self._closed(builder, builder.q)
        holding = "" if self._checked_later(builder.ahead) else self.name
        builder.note(f"grasp {self.name}: close", MoveFingers(closed, holding), held)
        chosen = approach if self.pitch is None else None
        builder.taken = GraspInfo(builder.at, chosen, scene_object)

    def _closed(self, builder: PlanBuilder, q: FloatArray) -> State:
        """Return the state at ``q`` (5,) [rad] in which the closed fingers hold the object.

        Raises InputError if they do not, or are so near to something that they could not leave.
        """
        now = builder.state
        builder.state = builder.standing(q)
        held = builder.after(cmd.SetGripper(builder.plan_context.arm.gripper.lower))
        builder.state = now
        if held.grip is None:
            raise InputError(f"the fingers do not hold it: {_why_not_held(held)}.")
        others = tuple(each for each in held.objects if each.name != self.name)
        world = builder.plan_context.session.world_at(replace(held, objects=others))
        nearest = None if world is None else world.nearest(held.x_setpoint)
        if nearest is not None and nearest.distance < MARGIN:
            raise InputError(_too_near(nearest, MARGIN))
        return held

    def _checked_later(self, ahead: Sequence[object]) -> bool:
        """Return whether an ``if`` of ``ahead`` asks whether the object is held, before a grasp."""
        for step in ahead:
            if isinstance(step, Conditional) and step.condition == Held(self.name):
                return True
            if isinstance(step, Grasp):
                return False
        return False


def approaches(builder: PlanBuilder, scene_object: SceneObject) -> dict[str, tuple[Approach, ...]]:
    """Return the approaches that suit the shape of an object, by side, the preferred side first.

    The fingers close on two opposite sides of a box, or of the box round a mesh. The cup is only
    grasped from the front: from above the wrist could not pour it. Raises InputError if the object
    does not stand upright.
    """
    if scene_object.name == CUP:
        return {FRONT: tuple(map(Approach, PITCHES))}
    # Only steep fingertips come near what a low object stands on.
    low = scene_object.height < LOW
    front = tuple(map(Approach, STEEP_PITCHES[::-1] if low else (*PITCHES, *STEEP_PITCHES)))
    if scene_object.shape in (Shape.CYLINDER, Shape.SPHERE):
        return {FRONT: front, ABOVE: (Approach(DOWN),)}
    x, y, _ = builder.point(scene_object.T[:3, 3], in_base=True)
    side = builder.direction(scene_object.T[:3, 0], in_base=True)
    skew = math.atan2(y, x) - math.atan2(side[1], side[0])
    rolls = sorted((wrapped(skew + quarter * DOWN) for quarter in range(4)), key=abs)
    found = {ABOVE: tuple(Approach(DOWN, roll) for roll in rolls)}
    return found | ({FRONT: front} if abs(rolls[0]) <= MAX_SKEW else {})


def _point(builder: PlanBuilder, scene_object: SceneObject, height: float) -> FloatArray:
    """Return the point (3,) [m] in {S} at ``height`` [m] over the underside of the object."""
    return builder.point(scene_object.T[:3, 3] + (0.0, 0.0, height), in_base=True)


def _joint_room(builder: PlanBuilder, q: FloatArray) -> float:
    """Return the smallest distance [rad] of the joints ``q`` (5,) [rad] to their limits."""
    chain = builder.chain
    return float(np.minimum(q - chain.lower, chain.upper - q).min())


def _why_not_held(state: State) -> str:
    """Return why the closed fingers do not hold an object."""
    for finding in state.findings:
        if finding.reason is Reason.CONTACT and finding.parts:
            return f"{' and '.join(map(part, finding.parts))} would touch first"
        if finding.reason is Reason.LOPSIDED:
            return "only one of them would touch it"
    return "they close without touching it"


def _too_near(nearest: Contact, minimum: float) -> str:
    """Return that two bodies would be nearer than ``minimum`` [m]."""
    one, other = map(part, nearest.parts)
    return (
        f"{one} and {other} would be {1e3 * nearest.distance:.1f} mm apart; the minimum is "
        f"{1e3 * minimum:.1f} mm."
    )


def _no_approach(scene_object: SceneObject, side: str) -> str:
    """Return why no approach from ``side`` suits the object."""
    if scene_object.name == CUP:
        return "the cup is grasped from the front, because from above the wrist could not pour it."
    return (
        "its sides are turned too far, seen from the arm, so the fingers cannot hold it from the "
        f"{side}. Grasp it from above, or turn it."
    )


def _smallest_distance(
    builder: PlanBuilder, point: FloatArray, approach: Approach, least: float
) -> tuple[float, FloatArray]:
    """Return the smallest distance [m] of the tool before ``point`` at which the palm has room.

    It is at least ``least`` [m]. The second value is the joints (5,) [rad] at that distance.
    """

    def joints_with_room(distance: float) -> tuple[float, FloatArray]:
        q = builder.joints_of(before(point, approach, distance))
        nearest = None if world is None else world.nearest(np.append(q, fingers))
        if nearest is not None and nearest.distance < PALM_CLEARANCE:
            raise InputError(_too_near(nearest, PALM_CLEARANCE))
        return distance, q

    world, fingers = builder.world, builder.state.gripper_setpoint
    distances = (least + np.arange(0.0, MAX_DISTANCE + DISTANCE_STEP, DISTANCE_STEP)).tolist()
    return builder.first(distances, joints_with_room)


STEPS: dict[str, type[Step]] = {"grasp": Grasp}
"""Program steps of this module, by their names in a script."""
