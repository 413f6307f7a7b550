"""Wait while a tilted cup pours."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.maths.water.flow import Water
from katana450.maths.water.units import FEMTOLITRE, ML

MAX_DRAIN = 180.0
"""[s] Maximum time to wait."""

END_FLOW = 0.2 * ML
"""[m^3/s] Flow at which a cup counts as emptied."""


@dataclass(frozen=True)
class Drain:
    """Wait until a tilted cup has poured enough.

    Attributes:
        vessel: name of the vessel.
        rest: volume that stays in it with its film [fl]; None to wait until the flow ends.
    """

    vessel: str
    rest: int | None = None

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        """Return no command."""
        return ()

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
