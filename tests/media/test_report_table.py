"""Test the table of a report and its figures: all digits, the water, its use as a motion."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from katana450.extensions.media import figures
from katana450.extensions.media.measures import PathTrace, PourRecord
from katana450.extensions.media.report import Report
from katana450.extensions.programs.run.simulation import Planned, plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH

WATER = {"cup_ml", "basin_ml", "air_ml", "spilled_ml", "cup_tilt_deg"}
TEXT = "steps:\n  - nudge: {axis: 5, by: 7}\n  - fill: 100\n  - nudge: {axis: 1, by: 3}\n"


def reported(text: str) -> tuple[Planned, Report]:
    plan = plan_script(parse(text), URDF_PATH)
    return plan, Report.of(plan.script, run_by_clock(plan), {}, ())


@pytest.fixture(scope="module")
def run() -> tuple[Planned, Report]:
    return reported(TEXT)


@pytest.fixture(scope="module")
def dry() -> tuple[Planned, Report]:
    """A run without water, of an arm that follows exactly."""
    return reported("steps: [nudge: {axis: 5, by: 7}]")


def test_table_has_the_water_once_there_is_some(
    run: tuple[Planned, Report], dry: tuple[Planned, Report]
) -> None:
    rows = list(csv.DictReader(io.StringIO(run[1].csv())))
    assert set(rows[0]) > WATER
    assert float(rows[-1]["cup_ml"]) == pytest.approx(100.0)
    assert float(rows[-1]["basin_ml"]) == 0.0
    assert float(rows[-1]["cup_tilt_deg"]) == pytest.approx(0.0, abs=1e-6)
    assert float(rows[-1]["lip_above_water_mm"]) > 1.0
    without = list(csv.DictReader(io.StringIO(dry[1].csv())))
    assert not WATER & set(without[0])


def test_water_figure_is_drawn(run: tuple[Planned, Report]) -> None:
    pour = PourRecord.of(run[1].run)
    assert pour is not None
    assert pour.flow.max() == 0.0
    assert figures.water_figure(pour).startswith(b"\x89PNG")


def test_flow_is_the_loss_of_the_cup() -> None:
    t = np.linspace(0.0, 2.99, 300)
    cup: FloatArray = np.clip(200.0 - 80.0 * (t - 1.0), 100.0, 200.0)
    zero = np.zeros(300)
    pour = PourRecord(t, cup, 200.0 - cup, zero, zero, zero, zero)
    assert pour.flow[150] == pytest.approx(80.0)
    assert pour.flow[50] == pour.flow[299] == 0.0


def test_the_drawn_error_is_the_largest_of_every_part_of_every_path() -> None:
    rng = np.random.default_rng(3)
    sigma = np.linspace(0.0, 1.0, 2001)
    off = rng.normal(size=(3, 2001, 3))
    still = np.zeros((2001, 3))
    paths = [PathTrace("line", sigma, still, error, np.zeros(2001)) for error in off]
    middles, drawn = figures.largest(paths)
    errors = np.linalg.norm(off, axis=2).max(axis=0)
    half = 0.5 / figures.PARTS
    for middle, most in zip(middles, drawn, strict=True):
        near = np.abs(sigma - middle)
        assert errors[near < half - 1e-9].max() <= most <= errors[near < half + 1e-9].max()
    assert drawn.max() == errors.max()
