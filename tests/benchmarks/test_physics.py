"""The physics benchmark measures what it says."""

from __future__ import annotations

import pytest

from benchmarks.physics import SCENES, main


def test_table_has_every_scene(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--ticks", "2"])
    rows = capsys.readouterr().out.splitlines()[-len(SCENES) :]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == [*SCENES]
    assert all(float(cell) > 0.0 for row in rows for cell in row.strip("| ").split(" | ")[1:])
