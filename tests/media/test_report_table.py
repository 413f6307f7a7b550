"""Test the table of a report: all digits, the water, and its use as a motion."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.export.trajectory_file import load_motion
from katana450.extensions.media import figures
from katana450.extensions.media.pour_record import COLUMNS, PourRecord
from katana450.extensions.media.report import Report
from katana450.extensions.programs.clocked_run import Planned, plan_script, run_by_clock
from katana450.extensions.programs.script import parse
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH

TEXT = "steps:\n  - nudge: {axis: 5, by: 7}\n  - fill: 100\n  - nudge: {axis: 1, by: 3}\n"


def reported(text: str) -> tuple[Planned, Report]:
    plan = plan_script(parse(text), URDF_PATH)
    trace = run_by_clock(plan).trace
    return plan, Report.of(plan.script, plan.program, plan.robot.require_arm(), trace, {}, ())


@pytest.fixture(scope="module")
def run() -> tuple[Planned, Report]:
    return reported(TEXT)


def test_table_is_read_as_the_motion_that_was_run(
    run: tuple[Planned, Report], tmp_path: Path
) -> None:
    plan, report = run
    path = tmp_path / "trace.csv"
    path.write_text(report.csv(), encoding="utf-8")
    motion = load_motion(path, plan.robot)
    assert (motion.t == report.trace.t - report.trace.t[0]).all()
    for axis, name in enumerate(plan.robot.driven[:5]):
        # Degrees and back: one rounding each way.
        assert np.allclose(motion.values[name], report.trace.q[:, axis], rtol=4e-16, atol=0.0)


def test_table_has_the_water_once_there_is_some(run: tuple[Planned, Report]) -> None:
    rows = list(csv.DictReader(io.StringIO(run[1].csv())))
    assert set(COLUMNS) < set(rows[0])
    assert float(rows[-1]["cup_ml"]) == pytest.approx(100.0)
    assert float(rows[-1]["basin_ml"]) == 0.0
    assert float(rows[-1]["cup_tilt_deg"]) == pytest.approx(0.0, abs=1e-6)
    assert float(rows[-1]["lip_above_water_mm"]) > 1.0
    without = list(
        csv.DictReader(io.StringIO(reported("steps: [nudge: {axis: 5, by: 7}]")[1].csv()))
    )
    assert not set(COLUMNS) & set(without[0])


def test_water_figure_is_drawn(run: tuple[Planned, Report]) -> None:
    pour = PourRecord.of(run[1].trace)
    assert pour is not None
    assert pour.flow.max() == 0.0
    assert figures.water_figure(pour).startswith(b"\x89PNG")


def test_flow_is_the_loss_of_the_cup() -> None:
    t = np.linspace(0.0, 2.99, 300)
    cup: FloatArray = np.clip(200.0 - 80.0 * (t - 1.0), 100.0, 200.0)
    zero = np.zeros(300)
    pour = PourRecord(t, cup, zero, 200.0 - cup, zero, zero, zero, zero)
    assert pour.flow[150] == pytest.approx(80.0)
    assert pour.flow[50] == pour.flow[299] == 0.0


def test_broken_table_is_refused_with_its_row(run: tuple[Planned, Report], tmp_path: Path) -> None:
    plan, report = run
    path = tmp_path / "trace.csv"
    lines = report.csv().splitlines()
    lines[3] = lines[3].replace(lines[3].split(",")[4], "much", 1)
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match=r"Row 3 of .*much"):
        load_motion(path, plan.robot)
    assert math.isfinite(report.trace.t[-1])
