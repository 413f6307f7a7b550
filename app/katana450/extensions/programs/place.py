"""The steps that put the held object somewhere: ``place``, ``set_down``, ``release``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from katana450.arm.control.pouring import BASIN, is_vessel
from katana450.arm.control.scene_objects import MAX_COORDINATE, SceneObject
from katana450.arm.control.support import check_carried, is_over, surface_below
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.actions import MoveFingers
from katana450.extensions.programs.approach import UP
from katana450.extensions.programs.carry import APPROACHES, carry
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.finger_planning import with_fingers
from katana450.extensions.programs.places import point
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.schema_parts import (
    LENGTH,
    OBJECT,
    TEXT,
    TURN,
    Schema,
    any_of,
    mapping,
    reference,
)
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step, nothing
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.tool import DragTarget
from katana450.maths.planning.plan import MARGIN

RELEASE_HEIGHT = MARGIN + 2e-4
"""[m] Height over its support at which the fingers release an object."""

MAX_FALL = 0.01
"""[m] Maximum height from which ``release`` lets an object fall."""

CARRY_HEIGHTS = (0.1, 0.07, 0.05, 0.03, 0.015)
"""[m] Heights over its new place at which an object is brought there, tried from the highest."""


@dataclass(frozen=True, eq=False)
class PlaceHeld:
    """Put the held object down somewhere, upright, and draw back.

    Attributes:
        at: (3,) its place [m]; the last number, the height of its underside, is NaN for that of
            whatever is below. None for the middle of ``on``.
        in_base: whether ``at`` is in the base frame instead of {S}.
        on: name of the object on which to place it; "" for whatever is below.
        yaw: its angle about the vertical [rad]; None for any.
    """

    schema: ClassVar[Schema] = {
        **mapping(
            "Put the held object down, and draw back",
            "",
            {
                "at": any_of(
                    "Its place: the name of a pose, [x, y, z], or x, y and, if wanted, z, yaw",
                    TEXT,
                    reference("point"),
                    mapping(
                        "Its place",
                        "x y",
                        {
                            "x": LENGTH,
                            "y": LENGTH,
                            "z": {**LENGTH, "description": "Height of its underside, mm"},
                            "yaw": {**TURN, "description": "Angle about the vertical, deg"},
                        },
                    ),
                ),
                "on": {**OBJECT, "description": "Object that carries it; its middle without `at`"},
            },
        ),
        "minProperties": 1,
    }

    at: FloatArray | None
    in_base: bool
    on: str
    yaw: float | None

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read {at: {x, y, z, yaw}, on}. Raises ScriptError."""
        fields = Fields(value, "a place step")
        at, yaw = fields.take("at", lambda each: _spot(each, setting), (None, None))
        on = fields.take("on", read.text, "")
        fields.done()
        if at is None and not on:
            raise value.wrong("`place` needs `at` or `on`.")
        if at is not None and on and not math.isnan(at[2]):
            raise value.wrong("Give either `on` or the height z, which follows from `on`.")
        return cls(at, setting.in_base, on, yaw)

    def build(self, builder: PlanBuilder) -> None:
        """Plan the way and the release. Raises InputError if it is not possible."""
        held = held_object(builder, "place")
        spot = self._spot(builder, held)
        try:
            builder.first(
                _over(builder, held, spot, self.yaw),
                lambda low: _bring(builder, held, low),
            )
        except InputError as error:
            raise error.after(f"{held.name} cannot be placed there") from error

    def _spot(self, builder: PlanBuilder, held: SceneObject) -> FloatArray:
        """Return the place (3,) [m] of the underside in the base frame. Raises InputError."""
        at = np.zeros(3)
        if self.on:
            at = builder.scene_object(self.on).T[:3, 3]
        if self.at is not None:
            T = np.eye(4) if self.in_base else builder.plan_context.T_base_shoulder
            at = T[:3, :3] @ np.nan_to_num(self.at) + T[:3, 3]
        if self.at is None or math.isnan(self.at[2]):
            high = _standing(held, np.array((at[0], at[1], MAX_COORDINATE)))
            at = np.array((at[0], at[1], surface_below(_objects_around(builder), high)))
        standing = _standing(held, at)
        if self.on:
            below = builder.scene_object(self.on)
            if abs(surface_below([below], standing) - at[2]) > RELEASE_HEIGHT or at[2] <= 0.0:
                raise InputError(
                    f"{self.on} cannot carry {held.name} there: its top must be level, and the "
                    f"middle of {held.name} over it."
                )
        _check_support(builder, standing)
        return at


@dataclass(frozen=True)
class SetDown:
    """Put the held object back to its place of the grasp, and draw back."""

    schema: ClassVar[Schema] = {
        "type": "null",
        "description": "Put the held object back to where it was grasped, and draw back",
    }

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the step, which takes no value. Raises ScriptError."""
        nothing(value, "set_down")
        return cls()

    def build(self, builder: PlanBuilder) -> None:
        """Plan the motions. Raises InputError if nothing is held, or there is no room."""
        taken = builder.taken
        if builder.state.grip is None or taken is None:
            raise InputError("The hand holds no object that this program grasped.")
        at = taken.at
        above = at.moved(at.position * (1, 1, 0) + builder.target.position * UP)
        carry(builder, above, "back")
        low = at.moved(at.position + RELEASE_HEIGHT * UP)
        builder.lead([builder.planning.line(above, low)], "set down")
        let_go(builder)


@dataclass(frozen=True)
class Release:
    """Open the fingers where the arm is, and draw back; the object stands on what is below it."""

    schema: ClassVar[Schema] = {
        "type": "null",
        "description": "Open the fingers on the held object where it is, and draw back",
    }

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the step, which takes no value. Raises ScriptError."""
        nothing(value, "release")
        return cls()

    def build(self, builder: PlanBuilder) -> None:
        """Plan the release. Raises InputError if the object would fall, or there is no room."""
        check_fall(builder, held_object(builder, "release"))
        let_go(builder)


def held_object(builder: PlanBuilder, step: str) -> SceneObject:
    """Return the object between the fingers. Raises InputError with the remedy if there is none."""
    for each in builder.state.objects:
        if each.held:
            return each
    raise InputError(f"The hand holds nothing to {step}. `pick` an object first.")


def check_fall(builder: PlanBuilder, held: SceneObject) -> None:
    """Raise InputError if the held object would fall, or nothing carries it, if it is released."""
    T = builder.plan_context.session.environment.pose(held, builder.state.x_setpoint)
    lifted = replace(held, T=T, held=False)
    below = surface_below(_objects_around(builder), lifted)
    _check_support(builder, _standing(held, np.append(T[:2, 3], below)))
    fall = float(T[2, 3]) - below
    if fall > MAX_FALL:
        raise InputError(
            f"{held.name} would fall {1e3 * fall:.0f} mm. Lower it to at most "
            f"{1e3 * MAX_FALL:.0f} mm first, or use `place`."
        )


def _check_support(builder: PlanBuilder, standing: SceneObject) -> None:
    """Raise InputError if nothing carries the object ``standing``, or an open vessel would."""
    objects = _objects_around(builder)
    for each in objects:
        if (is_vessel(each) or each.name == BASIN) and is_over(standing, each):
            raise InputError(
                f"{each.name} is open at its top and cannot carry {standing.name}. Choose a place "
                "beside it."
            )
    check_carried(builder.plan_context.session.environment.table, objects, standing)


def _objects_around(builder: PlanBuilder) -> list[SceneObject]:
    """Return the objects that the hand does not carry."""
    return [each for each in builder.state.objects if not each.carried]


def let_go(builder: PlanBuilder) -> None:
    """Append the opening of the fingers and the retreat. Raises InputError without room."""
    at, q, hand = builder.target, builder.q, builder.hand
    opened = builder.plan_context.arm.gripper.opened
    builder.note("let go", MoveFingers(opened), with_fingers(builder, opened))

    def draw_back(away: float) -> None:
        end = hand.retreat(q, away)
        builder.lead([builder.planning.line(at, end)], "draw back")

    try:
        builder.first(APPROACHES, draw_back)
    except InputError as error:
        raise error.after("There is no room to draw back") from error
    builder.taken = None


def _spot(value: YamlValue, setting: ScriptContext) -> tuple[FloatArray, float | None]:
    """Read {x, y, z, yaw} or the name of a pose; z is NaN if it is absent. Raises ScriptError."""
    if value.kind != "mapping":
        return point(value, setting), None
    fields = Fields(value, "the place of an object")
    x, y = (fields.need(name, read.millimetres(), 0.0) for name in "xy")
    z = fields.take("z", read.millimetres(), math.nan)
    yaw = fields.take("yaw", read.angle(-360.0, 360.0), None)
    fields.done()
    return np.array((x, y, z)), yaw


def _standing(held: SceneObject, at: FloatArray) -> SceneObject:
    """Return the held object upright with its underside at ``at`` (3,) [m] in the base frame."""
    return replace(held, T=se3.from_rotation_translation(np.eye(3), at), held=False)


def _bring(builder: PlanBuilder, held: SceneObject, low: DragTarget) -> None:
    """Plan the way to ``low``, from above, and the release there. Raises InputError."""
    name = f"place {held.name}"

    def down_from(height: float, *, straight: bool) -> None:
        above = low.moved(low.position + height * UP)
        if straight:
            carry(builder, above, f"{name}: carry")
        else:
            builder.move_to(builder.joints_of(above), f"{name}: carry")
        builder.lead([builder.planning.line(builder.target, low)], f"{name}: lower")
        let_go(builder)

    try:
        builder.first(CARRY_HEIGHTS, lambda height: down_from(height, straight=True))
    except InputError:
        # A way round obstacles may tilt the object, and a vessel would spill.
        if is_vessel(held):
            raise
        builder.first(CARRY_HEIGHTS, lambda height: down_from(height, straight=False))


def _over(
    builder: PlanBuilder, held: SceneObject, spot: FloatArray, yaw: float | None
) -> Sequence[DragTarget]:
    """Return the tools that hold the object over ``spot`` with this ``yaw``; see `HandPlanning`."""
    T_base_object = builder.plan_context.session.environment.pose(held, builder.state.x_setpoint)
    goal = builder.point(spot + RELEASE_HEIGHT * UP, in_base=True)
    return builder.hand.over(held, T_base_object, builder.q, goal, yaw)


STEPS: dict[str, type[Step]] = {"place": PlaceHeld, "set_down": SetDown, "release": Release}
"""Steps of this module, by their names in a script."""
