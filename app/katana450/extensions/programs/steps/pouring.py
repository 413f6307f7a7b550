"""The step ``pour``: empty a vessel, or a part of it, into an object, planned from its place."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from katana450.arm.control.objects.pouring import CUP, is_vessel
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import Action, SetSpeed, Wait
from katana450.extensions.programs.building.hand_motions import carry
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.building.vessel_turn import (
    VesselTurn,
    film_after,
    tilt_for,
    turns_over,
)
from katana450.extensions.programs.language import kinds
from katana450.extensions.programs.language.kinds import NAME, ObjectName, whole
from katana450.maths.water.flow import VesselWater, Water
from katana450.maths.water.units import FEMTOLITRE, MILLILITRE, ML, counted

MAX_DRAIN = 180.0
"""[s] Maximum time to wait."""

END_FLOW = 0.2 * ML
"""[m^3/s] Flow at which a cup counts as emptied."""


@dataclass(frozen=True)
class Drain(Action):
    """Wait until a tilted cup has poured enough.

    Attributes:
        vessel: name of the vessel.
        rest: volume that stays in it with its film [fl]; None to wait until the flow ends.
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
            left = (water.kept - self.rest) * FEMTOLITRE / ML
            raise InputError(f"After {MAX_DRAIN:g} s, {left:.1f} ml have still to be poured.")
        return water.kept <= self.rest

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

PART_TIME = 10.0
"""[s] Duration of the pour of a part, for an estimate of the film on the wall."""

SHAKES = 3
"""Number of shakes after all is poured, unless given."""

POURING = "pour"
"""Name of the task that turns the cup over."""


@dataclass(frozen=True)
class Pour(Step, word="pour"):
    """Carry a held vessel over an object, turn it over, shake it, and turn it back.

    It stays upright until then. An arm of the five-axis family keeps the pitch of the grasp, and
    turns it by the roll of its wrist; over another vessel the lip stays in its place. Other arms
    tilt it about its lip; those with four axes do so in their plane.

    Attributes:
        into: name of the object.
        source: name of the vessel in the hand; None for any.
        volume: how much to pour [m^3]; None for all. The cup is tilted until the flow is PART_FLOW
            when the rest is left, kept so until then, and turned back.
        shake: number of shakes after all is poured; None for SHAKES.
    """

    short = "into"

    into: ObjectName
    source: Annotated[
        str | None, NAME.about("The vessel in the hand, for a check").named("from")
    ] = None
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
            part = water.kept - counted(rest)
            inside = pouring.water_environment(plan.state.objects).vessels[self.into].inside
            room = counted(inside.capacity) - other.kept
            if part > room:
                raise InputError(
                    f"{self.into} has room for {room / MILLILITRE:.1f} ml, which is less than the "
                    f"{part / MILLILITRE:.1f} ml to pour; give a smaller `ml`."
                )
            volumes[self.into] = other.kept + part
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
        name = self.source or (held.name if held is not None and is_vessel(held) else CUP)
        if held is None or held.name != name:
            raise InputError(f"The {name} is not in the hand: `grasp: {name}` first.")
        if not is_vessel(held):
            raise InputError(f"{name} holds no water: only the cup and vessels are poured.")
        return held

    def _rest(self, vessel: SceneObject, water: VesselWater) -> float:
        """Return the volume [m^3] that stays in it. Raises InputError for too little water."""
        if self.volume is None:
            return 0.0
        held = water.kept * FEMTOLITRE
        # The water is counted in whole femtolitres.
        if counted(self.volume) > water.kept:
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
        film = film_after(self.volume, rest, PART_TIME, inside)
        return float(tilt_for(PART_FLOW, rest - film, inside))

    def _turned(
        self,
        plan: PlanState,
        vessel: SceneObject,
        way: VesselTurn,
        rest: float,
    ) -> PlanState:
        """Return ``plan`` with the motions of ``way`` at their pace, and the draining."""
        plan = carry(plan, way.at, f"over {self.into}")
        pace, end = POUR_PACE if self.volume is None else PART_PACE, way.end
        plan = plan.with_action("slowly", SetSpeed(pace)).lead([way.line(0.0, end)], POURING)
        if self.shakes:
            back = way.end - math.copysign(SHAKE_ANGLE, way.end)
            plan = plan.lead([way.line(end, back), way.line(back, end)] * self.shakes, "shake")
        return self._drain(plan, vessel, rest).lead([way.line(end, 0.0)], "turn back")

    def _drain(self, plan: PlanState, vessel: SceneObject, rest: float) -> PlanState:
        """Return ``plan`` with the wait until the last water, or the part, has run out."""
        left = None
        if self.volume is None:
            plan = plan.with_action("drain", Wait(DRAIN_TIME))
        else:
            left = counted(rest + PART_FLOW * REACTION_TIME)
        plan = plan.with_action("drain", Drain(vessel.name, left))
        return plan.with_action("full speed", SetSpeed(1.0))
