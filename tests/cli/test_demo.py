"""The commands ``demo`` and ``run`` without a server."""

from __future__ import annotations

import io
import itertools
import json
import math
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from katana450.cli.main import main


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("matplotlib")
    out = tmp_path_factory.mktemp("demo") / "report"
    printed = io.StringIO()
    with redirect_stdout(printed):
        assert main(["demo", "circle", "--headless", "--report", str(out)]) == 0
    assert "without its gripper" in printed.getvalue()
    return out


@pytest.mark.long
def test_the_circle_is_as_exact_as_in_the_paper(out: Path) -> None:
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert next(iter(report)) == "max_position_error_mm"
    assert 0.0 < report["max_position_error_mm"] < 1e-12
    assert 0.0 < report["executed_position_error_mm"] < 1e-9
    # Between two ticks the drive takes the chord: an error of v^2 dt^2 / (8 r), with about 0.19 m/s
    # and 100 mm.
    assert 1e-3 < report["between_ticks_error_mm"] < 1e-2
    assert report["path_length_mm"] == pytest.approx(200.0 * math.pi, rel=1e-5)
    assert report["margin_to_limits_deg"] > 5.0
    assert report["smallest_singular_value"] > 0.1
    assert report["max_speed_fraction"] <= 1.0
    assert report["nearest_clearance_mm"] > 6.0
    assert report["bounds_held"]
    assert report["gripper"] == "none"


@pytest.mark.long
def test_the_same_seed_gives_the_same_report(out: Path, tmp_path: Path) -> None:
    assert main(["demo", "circle", "--headless", "--report", str(tmp_path)]) == 0

    def lines(directory: Path) -> list[str]:
        text = (directory / "report.json").read_text(encoding="utf-8")
        return [line for line in text.splitlines() if '"written"' not in line]

    assert lines(tmp_path) == lines(out)
    for name in ("trace.csv", "tracing.png", "path.png", "joints.png", "speeds.png"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes(), name


@pytest.mark.long
def test_pouring_is_shown_as_in_the_paper(tmp_path: Path) -> None:
    """Check the phases of figures 9 to 12: initial posture, grasping, approaching, emptying."""
    assert main(["demo", "pour", "--headless", "--report", str(tmp_path)]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["margin_to_limits_deg"] > 2.0
    shown = []
    for name in ("initial", "grasping", "approaching", "emptying"):
        with Image.open(tmp_path / f"{name}.png") as picture:
            shown.append(np.asarray(picture).astype(int))
    for one, other in itertools.combinations(shown, 2):
        # At least the hand is at another place.
        assert (np.abs(one - other).sum(axis=2) > 60).mean() > 0.005
    figures = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    # The contact of cup and table before the lift does not count as clearance of the arm.
    assert 6.0 < figures["nearest_clearance_mm"] < 60.0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 99.5 <= figures["emptied_percent"] <= 100.0
    assert f"Emptied: {figures['emptied_percent']:.4g} %; at least 99.5" in page
    captions = ("Initial configuration", "Grasping the cup", "Approaching the", "Emptying the cup")
    places = [page.index(caption) for caption in captions]
    assert places == sorted(places)


def test_missed_bound_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "impossible.yaml"
    script.write_text(
        "gripper: none\nsteps:\n  - joints: [0, -60, 80, 8, 0]\n"
        "expect:\n  duration_s: {at_most: 0.1}\n  path_length_mm: {at_least: 1}\n"
    )
    assert main(["run", str(script), "--headless"]) == 1
    said = capsys.readouterr().err
    assert "duration_s is" in said
    assert "path_length_mm was not measured" in said


def test_script_errors_are_reported_with_line_and_column(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "wrong.yaml"
    script.write_text("steps:\n  - hme\n  - wait: x\n")
    assert main(["run", str(script), "--headless"]) == 1
    said = capsys.readouterr().err
    assert f"{script}:2:5: There is no step 'hme'; did you mean 'home'?" in said
    assert f"{script}:3:11: " in said
    assert main(["run", str(tmp_path / "none.yaml"), "--headless"]) == 1


def test_a_dry_run_only_plans(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "circle", "--dry-run"]) == 0
    printed = capsys.readouterr().out
    assert "628 mm" in printed
    assert "3 steps" in printed
    assert "_link" not in printed
