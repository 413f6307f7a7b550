"""The steps that lift an object and put it somewhere: ``pick``, ``place``, ``stack`` and others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Any

import numpy as np

from katana450.arm.control.objects.loose_objects import check_carried, is_over, surface_below
from katana450.arm.control.objects.pouring import BASIN, is_vessel
from katana450.arm.control.state.scene_objects import MAX_COORDINATE, SceneObject
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import MoveFingers
from katana450.extensions.programs.building.plan_state import (
    APPROACHES,
    PlanState,
    carry,
    with_fingers,
)
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.kinds import NAME, SPOT, ObjectName, Spot
from katana450.extensions.programs.planning.curves import line_between
from katana450.extensions.programs.planning.hand_frames import UP
from katana450.extensions.programs.steps.grasp import Grasp
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.plan import MARGIN

RELEASE_HEIGHT = MARGIN + 2e-4
"""[m] Height over its support at which the fingers release an object."""

MAX_FALL = 0.01
"""[m] Maximum height from which ``release`` lets an object fall."""

LIFTS = (0.06, 0.04, 0.025, 0.015)
"""[m] Heights to which an object is lifted, tried from the highest."""

CARRY_HEIGHTS = (0.1, 0.07, 0.05, 0.03, 0.015)
"""[m] Heights over its new place at which an object is brought there, tried from the highest."""


@dataclass(frozen=True)
class PlaceHeld(Step, word="place", example="{at: {x: 300, y: 60}}"):
    """Put the held object down, and draw back.

    It stands upright then.

    Attributes:
        at: its place; None for the middle of ``on``.
        on: name of the object on which to place it; "" for whatever is below.
        in_base: whether ``at`` is in the base frame instead of {S}.
    """

    by_fingers = True
    noun = "`place`"
    needs = ("at", "on")

    at: Annotated[Spot | None, SPOT] = None
    on: Annotated[str, NAME.about("Object that carries it; its middle without `at`")] = ""
    in_base: bool = False

    @classmethod
    def mistakes(cls, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield the mistake of two heights."""
        spot = values.get("at")
        if spot is not None and "on" in values and not math.isnan(spot.z):
            yield "", "Give either `on` or the height z, which follows from `on`."

    def build(self, plan: PlanState) -> PlanState:
        """Plan the way and the release. Raises InputError if it is not possible."""
        held = held_object(plan, "place")
        spot = self._spot(plan, held)
        try:
            return plan.first(
                _over(plan, held, spot, None if self.at is None else self.at.yaw),
                lambda plan, low: _bring(plan, held, low),
            )
        except InputError as error:
            raise error.after(f"{held.name} cannot be placed there") from error

    def _spot(self, plan: PlanState, held: SceneObject) -> FloatArray:
        """Return the place (3,) [m] of the underside in the base frame. Raises InputError."""
        place = np.zeros(3)
        if self.on:
            place = plan.scene_object(self.on).T[:3, 3]
        if self.at is not None:
            T = np.eye(4) if self.in_base else plan.plan_context.T_base_shoulder
            place = T[:3, :3] @ np.nan_to_num((self.at.x, self.at.y, self.at.z)) + T[:3, 3]
        if self.at is None or math.isnan(self.at.z):
            high = _standing(held, np.array((place[0], place[1], MAX_COORDINATE)))
            place = np.array((place[0], place[1], surface_below(_objects_around(plan), high)))
        standing = _standing(held, place)
        if self.on:
            below = plan.scene_object(self.on)
            if abs(surface_below([below], standing) - place[2]) > RELEASE_HEIGHT or place[2] <= 0.0:
                raise InputError(
                    f"{self.on} cannot carry {held.name} there: its top must be level, and the "
                    f"middle of {held.name} over it."
                )
        _check_support(plan, standing)
        return place


@dataclass(frozen=True)
class SetDown(Step, word="set_down", example=""):
    """Put the held object back to where it was grasped, and draw back."""

    by_fingers = True
    noun = "`set_down`"

    def build(self, plan: PlanState) -> PlanState:
        """Plan the motions. Raises InputError if nothing is held, or there is no room."""
        grasp = plan.taken
        if plan.state.grip is None or grasp is None:
            raise InputError("The hand holds no object that this program grasped.")
        target = grasp.at
        above = target.moved(target.position * (1, 1, 0) + plan.target.position * UP)
        plan = carry(plan, above, "back")
        low = target.moved(target.position + RELEASE_HEIGHT * UP)
        return let_go(plan.lead([line_between(above, low)], "set down"))


@dataclass(frozen=True)
class Release(Step, word="release", example=""):
    """Open the fingers on the held object where it is, and draw back.

    The object stands on what is below it.
    """

    by_fingers = True
    noun = "`release`"

    def build(self, plan: PlanState) -> PlanState:
        """Plan the release. Raises InputError if the object would fall, or there is no room."""
        check_fall(plan, held_object(plan, "release"))
        return let_go(plan)


def held_object(plan: PlanState, step: str) -> SceneObject:
    """Return the object between the fingers. Raises InputError with the remedy if there is none."""
    for scene_object in plan.state.objects:
        if scene_object.held:
            return scene_object
    raise InputError(f"The hand holds nothing to `{step}`. `pick` an object first.")


def check_fall(plan: PlanState, held: SceneObject) -> None:
    """Raise InputError if the held object would fall, or nothing carries it, if it is released."""
    if held.joint is not None:
        return
    T = plan.plan_context.session.environment.pose(held, plan.state.x_setpoint)
    lifted = replace(held, T=T, held=False)
    below = surface_below(_objects_around(plan), lifted)
    _check_support(plan, _standing(held, np.append(T[:2, 3], below)))
    fall = float(T[2, 3]) - below
    if fall > MAX_FALL:
        raise InputError(
            f"{held.name} would fall {1e3 * fall:.0f} mm. Lower it to at most "
            f"{1e3 * MAX_FALL:.0f} mm first, or use `place`."
        )


def _check_support(plan: PlanState, standing: SceneObject) -> None:
    """Raise InputError if nothing carries the object ``standing``, or an open vessel would."""
    objects = _objects_around(plan)
    for other in objects:
        if (is_vessel(other) or other.name == BASIN) and is_over(standing, other):
            raise InputError(
                f"{other.name} is open at its top and cannot carry {standing.name}. Choose a place "
                "beside it."
            )
    check_carried(plan.plan_context.session.environment.table, objects, standing)


def _objects_around(plan: PlanState) -> list[SceneObject]:
    """Return the objects that the hand does not carry."""
    return [scene_object for scene_object in plan.state.objects if not scene_object.carried]


def let_go(plan: PlanState) -> PlanState:
    """Return ``plan`` with the fingers opened and the retreat. Raises InputError without room."""
    target, q, hand = plan.target, plan.q, plan.hand
    opened = plan.plan_context.arm.gripper.opened
    plan = plan.with_action("let go", MoveFingers(opened), with_fingers(plan, opened))

    def draw_back(plan: PlanState, away: float) -> PlanState:
        end = hand.retreat(q, away)
        return plan.lead([line_between(target, end)], "draw back")

    try:
        return replace(plan.first(APPROACHES, draw_back), taken=None)
    except InputError as error:
        raise error.after("There is no room to draw back") from error


def _standing(held: SceneObject, place: FloatArray) -> SceneObject:
    """Return the held object upright with its underside at ``place`` (3,) [m] in the base frame."""
    return replace(held, T=se3.from_rotation_translation(np.eye(3), place), held=False)


def _bring(plan: PlanState, held: SceneObject, low: ToolTarget) -> PlanState:
    """Plan the way to ``low``, from above, and the release there. Raises InputError."""
    name = f"place {held.name}"

    def down_from(plan: PlanState, height: float, *, straight: bool) -> PlanState:
        above = low.moved(low.position + height * UP)
        if straight:
            plan = carry(plan, above, f"{name}: carry")
        else:
            plan = plan.move_to(plan.joints_of(above), f"{name}: carry")
        return let_go(plan.lead([line_between(plan.target, low)], f"{name}: lower"))

    try:
        return plan.first(CARRY_HEIGHTS, partial(down_from, straight=True))
    except InputError:
        # A way round obstacles may tilt the object, and a vessel would spill.
        if is_vessel(held):
            raise
        return plan.first(CARRY_HEIGHTS, partial(down_from, straight=False))


def _over(
    plan: PlanState, held: SceneObject, spot: FloatArray, yaw: float | None
) -> Sequence[ToolTarget]:
    """Return the tools that hold the object over ``spot`` with this ``yaw``; see `HandPlanning`."""
    T_base_object = plan.plan_context.session.environment.pose(held, plan.state.x_setpoint)
    goal = plan.point(spot + RELEASE_HEIGHT * UP, in_base=True)
    return plan.hand.over(held, T_base_object, plan.q, goal, yaw)


@dataclass(frozen=True)
class Pick(Grasp, word="pick", example="cup"):
    """Grasp an object, and lift it."""

    def build(self, plan: PlanState) -> PlanState:
        """Plan grasp and lifting. Raises InputError if it is not possible."""
        plan = super().build(plan)
        target = plan.target

        def lift(plan: PlanState, height: float) -> PlanState:
            raised = target.moved(target.position + height * UP)
            return plan.lead([line_between(target, raised)], f"lift {self.name}")

        try:
            return plan.first(LIFTS, lift)
        except InputError as error:
            raise error.after(f"{self.name} cannot be lifted") from error


@dataclass(frozen=True)
class Stack(Pick, word="stack"):
    """Pick an object, and place it on the middle of another.

    Attributes:
        on: name of the object that carries it.
    """

    short = ""

    on: ObjectName = field(kw_only=True)

    @classmethod
    def mistakes(cls, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield the mistake of an object on itself."""
        if values.get("name") is not None and values["name"] == values.get("on"):
            yield "", f"{values['name']} cannot stand on itself."

    def build(self, plan: PlanState) -> PlanState:
        """Plan with the first grasp that can be placed. Raises InputError if there is none."""
        given_up, refused = plan.given_up, None
        before = replace(plan, taken=None, ahead=())
        while True:
            attempt = replace(before, given_up=given_up, is_brief=refused is not None)
            try:
                attempt = super().build(attempt)
                placed = PlaceHeld(on=self.on).build(attempt)
            except InputError as error:
                refused = refused or error
                if attempt.taken is None or attempt.taken.chosen is None:
                    raise refused from error
                given_up = (*given_up, attempt.taken.chosen)
            else:
                return replace(placed, is_brief=plan.is_brief)
