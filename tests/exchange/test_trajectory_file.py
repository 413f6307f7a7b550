"""Tests of motion files: read from CSV; invalid files are refused with the place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.export.playback import load_motion

TABLE = {
    "t": [1.0, 2.0, 2.5],
    "theta1": [0.0, 2.5, -1.0],
    "theta4": [0.0, -0.5, 0.5],
    "gripper": [0.0, 0.25, 0.3],
}


def test_a_table_is_a_motion(tmp_path: Path, katana: Robot) -> None:
    rows = [", ".join(map(repr, row)) for row in zip(*TABLE.values(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(TABLE), *rows, ""]))
    motion = load_motion(tmp_path / "a.csv", katana)
    np.testing.assert_array_equal(motion.t, [0.0, 1.0, 1.5])
    np.testing.assert_array_equal(motion.values["axis_1"], TABLE["theta1"])
    np.testing.assert_array_equal(motion.values["axis_4"], TABLE["theta4"])
    for finger in ("finger_right_joint", "finger_left_joint"):
        np.testing.assert_array_equal(motion.values[finger], TABLE["gripper"])
    np.testing.assert_array_equal(motion.values["axis_2"], np.zeros(3))


def test_joints_can_have_their_own_names(tmp_path: Path, gantry: Robot) -> None:
    (tmp_path / "a.csv").write_text("t,turn,theta1\n0,0,0\n1,9,0.4\n")
    motion = load_motion(tmp_path / "a.csv", gantry)
    np.testing.assert_array_equal(motion.values["turn"], [0.0, 9.0])
    np.testing.assert_array_equal(motion.values["rail"], [0.0, 0.4])
    np.testing.assert_allclose(motion.values["out"], -0.1 * motion.values["grip"] - 0.04)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "", "is empty"),
        ("a.csv", "x,theta1\n0,0\n1,0\n", "no column t"),
        ("a.csv", "t,theta1\n0,0\n", "has 1 rows"),
        ("a.csv", "t,theta1\n0,0\n0,0\n", "must increase.*in row 2"),
        ("a.csv", "t,theta1\n0,0\n1,0,0\n", "Row 2 .*3 values, not 2"),
        ("a.csv", "t,theta1\n0,0\n1,one\n", "Row 2 .*one"),
        ("a.csv", "t,theta1\n0,0\n1,nan\n", "theta1.*nan"),
        ("a.csv", "t,theta1\n0,0\n1,4\n", "axis_1 cannot be at 4 rad"),
        ("a.csv", "t,theta7\n0,0\n1,0\n", "'theta7', which is not a driven joint"),
        ("a.csv", "t,finger_left_joint\n0,0\n1,0\n", "not a driven joint"),
        ("a.csv", "t,theta1,theta1\n0,0,0\n1,0,0\n", "a column twice"),
        ("a.csv", "t,theta1,axis_1\n0,0,0\n1,0,0\n", "the joint axis_1 twice"),
        ("a.json", '{"t": [0, 1], "theta1": [0, 1]}', r"must end in \.csv"),
        ("a.txt", "t\n0\n1\n", r"must end in \.csv"),
    ],
)
def test_invalid_motion_is_refused(
    tmp_path: Path, katana: Robot, name: str, text: str, said: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=said):
        load_motion(tmp_path / name, katana)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, katana: Robot) -> None:
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("a.csv", "b.csv"):
        with pytest.raises(InputError, match="cannot be read"):
            load_motion(tmp_path / name, katana)
