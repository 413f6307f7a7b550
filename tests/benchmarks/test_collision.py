"""The collision benchmark measures the advertised quantities."""

from __future__ import annotations

import pytest

from benchmarks.collision import DRIVES, main, tick_rows, world_on_table
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot


@pytest.mark.long
def test_both_tables_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--postures", "3"])
    printed = capsys.readouterr().out
    assert "the nearest pair" in printed
    for drive in DRIVES:
        assert drive in printed


def test_drives_end_as_their_names_say(robot: Robot, arm: MountedArm) -> None:
    rows = {row.name: row.remark for row in tick_rows(arm, world_on_table(robot))}
    assert rows == {
        "through free space": "ok",
        "into the table": "blocked",
        "low over the table": "ok",
        "folding up": "blocked",
    }
