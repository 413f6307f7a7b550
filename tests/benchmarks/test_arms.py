"""The table of what each arm can do is measured on files, and has a row for each of them."""

from __future__ import annotations

from pathlib import Path

import pytest

import katana450
from benchmarks import arms


def written(folder: Path, name: str) -> Path:
    path = folder / "arm.urdf"
    path.write_text(arms.PUBLISHED[name], encoding="utf-8")
    return path


def test_row_is_measured_on_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arms, "POSES", 4)
    monkeypatch.setattr(arms, "PASSES", 1)
    name = "OpenMANIPULATOR-X"
    row = dict(zip(arms.HEAD, arms.cells(name, written(tmp_path, name)), strict=True))
    assert (row["arm"], row["axes"]) == (name, "4")
    assert row["solver"] == "closed form for four axes: pan and three parallel axes"
    assert row["branches"] == "2.0"
    assert 0.0 < float(row["exact, mm"]) < 1e-11
    assert 0.0 < float(row["call, µs"]) < 1e4
    assert row["drags"] == "6 of 6"
    assert row["grasp"] == "yes"


def test_drag_beyond_the_reach_and_missing_hand_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arms, "STEP", 5.0)
    path = written(tmp_path, "Puma 560")
    arm = katana450.load(path)
    assert arms.drags(arm).arrived == 0
    assert arms.grasp(arm, path) == "no hand"


def test_documentation_has_every_arm() -> None:
    text = arms.DOCS.read_text(encoding="utf-8")
    table = text[text.index(arms.BEGIN) : text.index(arms.END)]
    names = [line.split(" | ")[0].removeprefix("| ") for line in table.splitlines() if "| " in line]
    assert names == ["arm", "Katana450", *arms.PUBLISHED]
