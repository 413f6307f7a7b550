"""The water of a run over time: volumes, the tilt of the cup, and the lip above the water."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.pouring import MotionWithWater
from katana450.extensions.programs.run.simulation import Trace
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.units import MILLILITRE

FLOW_TICKS = 10
"""Number of ticks over which the flow is averaged."""

COLUMNS = (
    "cup_ml", "film_ml", "basin_ml", "air_ml", "spilled_ml", "cup_tilt_deg", "lip_above_water_mm",
)  # fmt: skip
"""Columns of the water in the table of a run."""


@dataclass(frozen=True, eq=False)
class PourRecord:
    """The water at N ticks; NaN before there is water.

    Attributes:
        t: (N,) [s].
        cup, film, basin, air, spilled: (N,) volumes [ml].
        tilt: (N,) tilt of the cup [rad].
        lip: (N,) height of the lip above the water [m]; NaN for an empty cup.
    """

    t: FloatArray
    cup: FloatArray
    film: FloatArray
    basin: FloatArray
    air: FloatArray
    spilled: FloatArray
    tilt: FloatArray
    lip: FloatArray

    @staticmethod
    def of(trace: Trace) -> PourRecord | None:
        """Return the record of ``trace``; None for a run without water."""
        rows = np.array([_row(poured) for poured in trace.water])
        if not (np.nan_to_num(rows[:, :5]) > 0.0).any():
            return None
        cup, film, basin, air, spilled, tilt = rows.T
        lip = np.where(np.isfinite(trace.margin) & (cup > 0.0), trace.margin, math.nan)
        return PourRecord(trace.t, cup, film, basin, air, spilled, tilt, lip)

    @property
    def flow(self) -> FloatArray:
        """The flow out of the cup (N,) [ml/s], the mean of FLOW_TICKS ticks."""
        kept = self.cup + self.film
        before = np.roll(kept, FLOW_TICKS)
        before[:FLOW_TICKS] = math.nan
        passed = self.t - np.roll(self.t, FLOW_TICKS)
        found = (before - kept) / np.where(passed > 0.0, passed, math.nan)
        # The filling of the cup is no flow.
        return np.maximum(np.nan_to_num(found), 0.0)

    def cells(self, tick: int) -> list[str]:
        """Return the values of COLUMNS at ``tick`` as text; what is not known is empty."""
        values = (
            self.cup[tick],
            self.film[tick],
            self.basin[tick],
            self.air[tick],
            self.spilled[tick],
            math.degrees(self.tilt[tick]),
            1e3 * self.lip[tick],
        )
        return ["" if math.isnan(value) else repr(float(value)) for value in values]


def _row(poured: MotionWithWater | None) -> tuple[float, ...]:
    """Return the volumes of ``COLUMNS`` [ml] and the tilt [rad]."""
    if poured is None:
        return (math.nan,) * 6
    water = poured.water
    volumes = (water.cup.volume, water.cup.film, water.basin, water.air, water.spilled)
    return (
        *(each / MILLILITRE for each in volumes),
        math.acos(min(max(float(water.cup.T[2, 2]), -1.0), 1.0)),
    )
