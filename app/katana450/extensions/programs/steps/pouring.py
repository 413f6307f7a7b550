"""The step ``pour``: empty a vessel, or a part of it, into an object, planned from its place.

An arm of the five-axis family rolls the vessel by its wrist. Other arms tilt it about its lip.

The tilt is the inverse of the flow over the lip of the cup. The surface is level and at rest. See
``maths/water/flow.py`` for the rules.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.polynomial.polynomial import polyfit, polyval

from katana450.arm.control.objects.pouring import is_vessel
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import Action, SetSpeed, Wait
from katana450.extensions.programs.building.plan_state import PlanState, carry
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language import kinds
from katana450.extensions.programs.language.kinds import ObjectName, whole
from katana450.extensions.programs.planning.curves import Curve, PoseTurn, ToolLine, ToolTurn
from katana450.extensions.programs.planning.hand_frames import UP
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.flow import (
    THINNING_TIME,
    VesselWater,
    Water,
    weir_flow,
)
from katana450.maths.water.units import FEMTOLITRE, GRAVITY, MILLILITRE, ML, counted

HALVINGS = 40
"""Number of halvings of the interval that contains the tilt: to 3e-12 rad."""


def flow_at(tilt: float, volume: float, cup: Cylinder) -> float:
    """Return the flow [m^3/s] out of a cup with ``volume`` [m^3] at ``tilt`` [rad]."""
    over = volume - cup.holds(tilt)
    head = -cup.margin(tilt, cup.level(tilt, volume))
    if over <= 0.0 or head <= 0.0:
        return 0.0
    return weir_flow(cup.radius, tilt, head, GRAVITY) + over / THINNING_TIME


def tilt_for(flow: float, volume: float, cup: Cylinder) -> float:
    """Return the tilt [rad] at which a cup with ``volume`` [m^3] pours ``flow`` [m^3/s].

    The flow grows with the tilt. The result is pi if the flow is not reached.
    """
    low, high = 0.0, math.pi
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if flow_at(middle, volume, cup) >= flow else (middle, high)
    return high


EMPTY_TILT: Final = math.radians(120.0)
"""[rad] Tilt of a cup that is emptied about its lip: past its side. It is not tilted farther."""

POUR_TURN: Final = math.radians(165.0)
"""[rad] Roll of a pour: with any tilt of the tool, the cup then lies past its side."""

UNDERSIDES: Final = (0.02, 0.05, 0.09)
"""[m] Heights of the upright cup over the rim below it, tried in this order."""

ABOVE_RIM: Final = 0.13
"""[m] Height of the tool above the rim of a basin: the cup is rolled over between them."""

AIM: Final = 0.015
"""[m] Distance of the lip before the middle of another vessel: as far as the water flies while it
falls, with the flows of a pour.
"""

NODES: Final = frozen(-np.cos(np.linspace(0.0, np.pi, 15)))
"""Places in the interval from -1 to 1, with its ends, through which polynomials are laid."""

ROUNDS: Final = 12
"""Number of corrections of the tool's place; each leaves less than a third of the error."""

FIRST_ROLL: Final = 1e-4
"""[1] Fraction of the roll at which the lip of an upright vessel is found."""


class VesselTurn(NamedTuple):
    """The motions that turn an upright vessel over. Angles [rad] count from upright.

    They are the tilt of a cup about its lip, or the roll of the tool, either way.

    Attributes:
        upright: the tool with the vessel upright.
        end: angle at the end of the pour.
        between: function that returns the even turn from one angle to another.
    """

    upright: ToolTarget
    end: float
    between: Callable[[float, float], Curve]


def _tilted(
    upright: ToolTarget,
    lip: FloatArray,
    axis: FloatArray,
    axis_in_pose: FloatArray,
    start: float,
    end: float,
) -> Curve:
    """Return the tilt about a level ``axis`` (3,) through the ``lip`` (3,) [m].

    axis_in_pose: the axis in the frame of the rotation of a `ToolTarget`.
    """
    return PoseTurn(upright, lip, axis, _evenly(start, end), axis_in_pose)


def _rolled(upright: ToolTarget, start: float, end: float) -> Curve:
    """Return the roll about the tool point."""
    one, other = (replace(upright, roll=upright.roll + roll) for roll in (start, end))
    return ToolLine(one, other)


def _rolled_in_place(
    upright: ToolTarget, offsets: FloatArray, whole: float, start: float, end: float
) -> Curve:
    """Return the roll that keeps the lip in its place.

    offsets: coefficients (n, 3) of the path of the tool point [m], of the powers of
        2 angle / whole - 1.
    """
    angles = _evenly(start, end)
    rolls = np.append(upright.roll + angles[0], angles[1:])
    places = 2.0 * polyval(NODES, angles) / whole - 1.0
    return ToolTurn(upright, rolls, _through(polyval(places, offsets).T))


def _evenly(start: float, end: float) -> FloatArray:
    """Return the coefficients (2,) of an even turn [rad], of the powers of 2 sigma - 1."""
    return np.array((0.5 * (start + end), 0.5 * (end - start)))


def turns_over(
    plan: PlanState,
    held: SceneObject,
    below: SceneObject,
    tilt: float | None,
) -> Iterator[VesselTurn]:
    """Yield the ways to turn the vessel in the hand over ``below``, the best first.

    Args:
        plan: the arm, which holds it.
        held: the vessel.
        below: what receives its water.
        tilt: its tilt at the end of the pour [rad]; None to empty it.

    Raises InputError for a tilt that the arm cannot give it, and out of reach.
    """
    level = plan.target
    if not level.is_pitched:
        if tilt is not None and tilt > EMPTY_TILT:
            raise InputError("No tilt of the cup pours this part; pour all of it, or less.")
        yield from _about_the_lip(plan, held, below, tilt)
        return
    roll = POUR_TURN if tilt is None else float(_roll_of(tilt, level.pitch))
    if tilt is not None and roll >= POUR_TURN:
        raise InputError("The wrist cannot tilt it that far; pour all of it, or less.")
    over = _over_vessel if is_vessel(below) else _over_basin
    for sign, limit in ((1.0, plan.chain.upper[4]), (-1.0, -plan.chain.lower[4])):
        # The turn is limited to the range of the wrist.
        turn = sign * min(roll, 0.995 * float(limit) - abs(level.roll))
        yield over(plan, held, below, level, turn, is_emptied=tilt is None)


def _about_the_lip(
    plan: PlanState, held: SceneObject, below: SceneObject, tilt: float | None
) -> Iterator[VesselTurn]:
    """Yield the ways to tilt an upright cup about its lip, by a hand that takes poses."""
    T = plan.plan_context.session.environment.pose(held, plan.state.x_setpoint)
    cup = plan.point(T[:3, 3] + held.height * T[:3, 2], in_base=True)
    over = plan.point(below.T[:3, 3] + (0.0, 0.0, below.height), in_base=True)
    level, hand, aim = plan.target, plan.hand, AIM if is_vessel(below) else 0.0
    for height in UNDERSIDES:
        point = over + (held.height + height) * UP
        for turn, toward, in_pose in hand.tilt_directions(plan.q, cup, point):
            lip = point - aim * toward
            axis, axis_in_pose = (frozen(np.cross(UP, d)) for d in (toward, in_pose))
            # The cup turns with the arm on the way to the basin.
            moved = so3.rotation_z(turn) @ (level.position - cup)
            tool = hand.turned(level, lip - held.extent[0] * toward + moved, turn)
            between = partial(_tilted, tool, frozen(lip), axis, axis_in_pose)
            yield VesselTurn(tool, EMPTY_TILT if tilt is None else tilt, between)


def _over_basin(
    plan: PlanState,
    held: SceneObject,
    below: SceneObject,
    level: ToolTarget,
    turn: float,
    *,
    is_emptied: bool,
) -> VesselTurn:
    """Return the roll with the lip over the middle of the object ``below`` when it pours."""
    over = plan.point(below.T[:3, 3] + (0.0, 0.0, below.height + ABOVE_RIM), in_base=True)
    position = over
    for _ in range(3):
        # When the cup lies on its side, or is tilted as far as it will be.
        tool = replace(level, position=position)
        tilted = 0.5 * turn if is_emptied else turn
        side = plan.joints_of(replace(tool, roll=level.roll + tilted))
        position = position + (over - _lip(plan, held, side)[0]) * (1.0, 1.0, 0.0)
    upright = replace(level, position=position)
    return VesselTurn(upright, turn, partial(_rolled, upright))


def _over_vessel(
    plan: PlanState,
    held: SceneObject,
    below: SceneObject,
    level: ToolTarget,
    turn: float,
    *,
    is_emptied: bool,  # noqa: ARG001
) -> VesselTurn:
    """Return the roll with the lip in one place over the vessel ``below``."""
    height = below.height + held.height + UNDERSIDES[0]
    over = plan.point(below.T[:3, 3] + (0.0, 0.0, height), in_base=True)
    positions, position = [], over
    for roll in (0.5 * turn * np.maximum(1.0 + NODES, FIRST_ROLL)).tolist():
        for _ in range(ROUNDS):
            tool = replace(level, position=position, roll=level.roll + roll)
            lip, toward = _lip(plan, held, plan.joints_of(tool))
            position = position + over - AIM * toward - lip
        positions.append(position)
    upright = replace(level, position=frozen(positions[0]))
    offsets = _through(np.array(positions) - positions[0])
    return VesselTurn(upright, turn, partial(_rolled_in_place, upright, offsets, turn))


def _lip(plan: PlanState, held: SceneObject, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lowest point (3,) [m] of the rim in {S}, and the level direction (3,) out of it.

    q: the joints (5,) [rad] with which the vessel is tilted.
    """
    environment = plan.plan_context.session.environment
    T = environment.pose(held, np.append(q, plan.state.gripper_setpoint))
    up = T[:3, 2]
    downhill = -(np.array((0.0, 0.0, 1.0)) - up[2] * up)
    downhill /= np.linalg.norm(downhill)
    rim = plan.point(T[:3, 3] + held.height * up + held.extent[0] * downhill, in_base=True)
    toward = np.array((up[0], up[1], 0.0)) / np.hypot(up[0], up[1])
    return rim, plan.direction(toward, in_base=True)


def _through(values: FloatArray) -> FloatArray:
    """Return the coefficients (n, 3) of the polynomial with the ``values`` (n, 3) at NODES."""
    return frozen(polyfit(NODES, values, len(NODES) - 1))


def _roll_of(tilt: npt.ArrayLike, pitch: float) -> FloatArray:
    """Return the roll [rad] of a tool with ``pitch`` [rad] at which a cup has ``tilt`` [rad].

    Rolling by phi tilts it by cos(tilt) = cos(phi) + (1 - cos(phi)) sin(pitch)^2. The result is pi
    where no roll tilts it that far.
    """
    steep = math.sin(pitch) ** 2
    return np.arccos(np.clip((np.cos(tilt) - steep) / (1.0 - steep), -1.0, 1.0))


MAX_DRAIN = 180.0
"""[s] Maximum time to wait."""

END_FLOW = 0.2 * ML
"""[m^3/s] Flow at which a cup counts as emptied."""


@dataclass(frozen=True)
class Drain(Action):
    """Wait until a tilted cup has poured enough.

    Attributes:
        vessel: name of the vessel.
        rest: volume that stays in it [fl]; None to wait until the flow ends.
    """

    vessel: str
    rest: int | None = None

    def done(self, state: State, waited: float) -> bool:
        """Return whether enough has flowed. Raises InputError if that takes too long."""
        if state.poured is None:
            raise InputError("There is no cup to pour.")
        water = state.poured.water.vessel(self.vessel)
        if water is None:
            raise InputError(f"There is no {self.vessel} to pour.")
        if self.rest is None:
            return outflow(state.poured.water) < END_FLOW or waited > MAX_DRAIN
        if waited > MAX_DRAIN:
            left = (water.volume - self.rest) * FEMTOLITRE / ML
            raise InputError(f"After {MAX_DRAIN:g} s, {left:.1f} ml have still to be poured.")
        return water.volume <= self.rest

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        """Return the fraction of the maximum time that has passed."""
        return min(waited / MAX_DRAIN, 1.0)


def outflow(water: Water) -> float:
    """Return the flow over the lip in the last time step [m^3/s]."""
    if not water.parcels or water.parcels[-1].age > 0.0:
        return 0.0
    newest = water.parcels[-1]
    return newest.volume * FEMTOLITRE / newest.span


POUR_PACE = 0.3
"""[1] Fraction of the speed while pouring: slow enough for a thin, coherent stream."""

PART_PACE = 0.12
"""[1] Fraction of the speed while a part is poured: the water in the cup hardly swings."""

MAX_POUR_PITCH = math.radians(60.0)
"""[rad] Maximum pitch of the tool for a pour."""

SHAKE_ANGLE = math.radians(25.0)
"""[rad] Amplitude of a shake."""

DRAIN_TIME = 1.5
"""[s] Minimum time for the last water to run out."""

PART_FLOW = 0.5 * ML
"""[m^3/s] Flow with which the pour of a part ends: slow enough to end it in time."""

REACTION_TIME = 0.25
"""[s] Time in which a cup that turns back still pours at the same flow."""

SHAKES = 3
"""Number of shakes after all is poured, unless given."""

POURING = "pour"
"""Name of the task that turns the cup over."""


@dataclass(frozen=True)
class Pour(Step, word="pour", example="basin"):
    """Carry a held vessel over an object, turn it over, shake it, and turn it back.

    It stays upright until then. An arm of the five-axis family keeps the pitch of the grasp, and
    turns it by the roll of its wrist; over another vessel the lip stays in its place. Other arms
    tilt it about its lip; those with four axes do so in their plane.

    Attributes:
        into: name of the object.
        volume: how much to pour [m^3]; None for all. The cup is tilted until the flow is PART_FLOW
            when the rest is left, kept so until then, and turned back.
        shake: number of shakes after all is poured; None for SHAKES.
    """

    by_fingers = True
    short = "into"

    into: ObjectName
    volume: Annotated[
        float | None,
        kinds.volume(1.0, 1000.0, "How much to pour, ml; all unless given").named("ml"),
    ] = None
    shake: Annotated[
        int | None, whole(0, 20, "Number of shakes after all is poured, 3 unless given")
    ] = None

    @classmethod
    def mistakes(cls, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield the mistake of a part that is shaken out."""
        if "volume" in values and values.get("shake"):
            yield "shake", "A shaken cup does not keep the rest: leave out `shake` or `ml`."

    @property
    def shakes(self) -> int:
        """The number of shakes."""
        if self.shake is None:
            return SHAKES if self.volume is None else 0
        return self.shake

    def build(self, plan: PlanState) -> PlanState:
        """Plan the pour, turning either way. Raises InputError if it is not possible."""
        vessel, below = self._vessel(plan), plan.scene_object(self.into)
        if below.carried:
            raise InputError(f"{self.into} is in the hand: name what stands below it.")
        poured = plan.state.poured
        water = None if poured is None else poured.water.vessel(vessel.name)
        if poured is None or water is None:
            raise InputError(f"There is no water in the {vessel.name}: `fill` it first.")
        rest = self._rest(vessel, water)
        volumes = {vessel.name: counted(rest)}
        pouring = plan.plan_context.session.pouring
        other = poured.water.vessel(self.into)
        if pouring is not None and other is not None:
            part = water.volume - counted(rest)
            inside = pouring.water_environment(plan.state.objects).vessels[self.into].inside
            room = counted(inside.capacity) - other.volume
            if part > room:
                raise InputError(
                    f"{self.into} has room for {room / MILLILITRE:.1f} ml, which is less than the "
                    f"{part / MILLILITRE:.1f} ml to pour; give a smaller `ml`."
                )
            volumes[self.into] = other.volume + part
        level = plan.target
        if level.is_pitched and level.pitch > MAX_POUR_PITCH:
            raise InputError(
                f"The {vessel.name} is held from above, where the wrist cannot tilt it: pick it "
                "with `side: front`."
            )
        try:
            plan = plan.first(
                turns_over(plan, vessel, below, self._tilt(plan, vessel, rest)),
                lambda plan, way: self._turned(plan, vessel, way, rest),
            )
        except InputError as error:
            message = f"The {vessel.name} cannot be emptied into {self.into}"
            raise error.after(message) from error
        return plan.with_still_water(volumes)

    def _vessel(self, plan: PlanState) -> SceneObject:
        """Return the vessel in the hand. Raises InputError without it."""
        held = next((other for other in plan.state.objects if other.held), None)
        if held is None:
            raise InputError("No vessel is in the hand: `grasp` the cup or a vessel first.")
        if not is_vessel(held):
            raise InputError(f"{held.name} holds no water: only the cup and vessels are poured.")
        return held

    def _rest(self, vessel: SceneObject, water: VesselWater) -> float:
        """Return the volume [m^3] that stays in it. Raises InputError for too little water."""
        if self.volume is None:
            return 0.0
        held = water.volume * FEMTOLITRE
        # The water is counted in whole femtolitres.
        if counted(self.volume) > water.volume:
            raise InputError(
                f"The {vessel.name} holds {held / ML:.1f} ml at this step, which is less than "
                f"{self.volume / ML:g} ml."
            )
        return max(held - self.volume, 0.0)

    def _tilt(self, plan: PlanState, vessel: SceneObject, rest: float) -> float | None:
        """Return the tilt [rad] at which the flow is PART_FLOW with ``rest`` [m^3] in the cup.

        None if all of it is poured.
        """
        pouring = plan.plan_context.session.pouring
        if self.volume is None or pouring is None:
            return None
        inside = pouring.water_environment(plan.state.objects).vessels[vessel.name].inside
        return float(tilt_for(PART_FLOW, rest, inside))

    def _turned(
        self,
        plan: PlanState,
        vessel: SceneObject,
        way: VesselTurn,
        rest: float,
    ) -> PlanState:
        """Return ``plan`` with the motions of ``way`` at their pace, and the draining."""
        plan = carry(plan, way.upright, f"over {self.into}")
        pace, end = POUR_PACE if self.volume is None else PART_PACE, way.end
        plan = plan.with_action("slowly", SetSpeed(pace)).lead([way.between(0.0, end)], POURING)
        if self.shakes:
            back = way.end - math.copysign(SHAKE_ANGLE, way.end)
            plan = plan.lead(
                [way.between(end, back), way.between(back, end)] * self.shakes, "shake"
            )
        return self._drain(plan, vessel, rest).lead([way.between(end, 0.0)], "turn back")

    def _drain(self, plan: PlanState, vessel: SceneObject, rest: float) -> PlanState:
        """Return ``plan`` with the wait until the last water, or the part, has run out."""
        left = None
        if self.volume is None:
            plan = plan.with_action("drain", Wait(DRAIN_TIME))
        else:
            left = counted(rest + PART_FLOW * REACTION_TIME)
        plan = plan.with_action("drain", Drain(vessel.name, left))
        return plan.with_action("full speed", SetSpeed(1.0))
