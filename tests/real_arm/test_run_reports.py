"""Reports of runs on measured arms: a simulated plant, a server with one, and the emulated arm."""

from __future__ import annotations

import csv
import json
import math
import sys
from pathlib import Path

import pytest

from katana450.cli.main import main
from tests.commands import completed

SCRIPT = """
name: Short line
frame: base
tool: tcp
steps:
  - home
  - line: {by: {y: 60}}
  - line: {by: {y: -60}}
expect:
  executed_position_error_mm: {at_most: 1.0e-6}
  measured_position_error_mm: {at_most: 5}
"""


def test_bound_on_a_measured_arm_needs_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "line.yaml"
    script.write_text(SCRIPT, encoding="utf-8")
    assert main(["run", str(script), "--headless"]) == 1
    assert "measured_position_error_mm was not measured" in capsys.readouterr().err
    assert main(["run", str(script), "--headless", "--plant", "katana450"]) == 0
    assert "Measured at the arm" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["run", str(script), "--headless", "--plant", "rubber"])


@pytest.mark.long
def test_circle_of_a_plant_has_commanded_and_measured_apart(tmp_path: Path) -> None:
    options = ("demo", "circle", "--headless", "--plant", "katana450", "--report", str(tmp_path))
    done = completed([sys.executable, "-m", "katana450", *options], seconds=120.0)
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["executed_position_error_mm"] < 1e-9
    assert report["bounds_held"]
    with (tmp_path / "trace.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["task"] == "circle"]
    # The paper's circle, by the measured points: across it and along its axis.
    off = []
    for row in rows:
        x, y, z = (float(row[f"measured_{axis}_mm"]) for axis in "xyz")
        off.append(math.hypot(x - 150.0, math.hypot(y, z + 110.0) - 100.0))
    assert report["measured_position_error_mm"] == pytest.approx(max(off), rel=0.02)
    assert 0.05 < max(off) < 2.0
    for name in ("measured.png", "joints.png", "path.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 5
