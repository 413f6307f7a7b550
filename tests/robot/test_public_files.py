"""Faults that many public robot descriptions have, and that readers in ROS overlook."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.link import SLOW_TURN
from katana450.arm.robot.loader import load
from katana450.errors import RobotDescriptionError
from tests.robot.hands import rail
from tests.robot.urdf_files import saved

ARM = Path(__file__).resolve().parent / "arms" / "pincherx_150.urdf"


@pytest.mark.parametrize(
    "beginning",
    [
        '\n\n<?xml version="1.0"?>\n',
        '  <?xml version="1.0" encoding="utf-8"?>\n',
        '<?xml version="0.0" ?>\n',
        "<?xml version='1.0' encoding='UTF-8' standalone='yes'?>",
        "\n",
        "",
    ],
)
def test_a_wrong_xml_declaration_is_overlooked(tmp_path: Path, beginning: str) -> None:
    robot = load(saved(tmp_path, beginning + rail()))
    assert robot.driven == ("slide_left", "slide_right")
    # The line of a fault is still that of the file.
    broken = beginning + rail().replace('lower="-0.5"', 'lower="low"', 1)
    line = broken[: broken.index('"low"')].count("\n") + 1
    with pytest.raises(RobotDescriptionError, match=f"line {line}: lower='low'"):
        load(saved(tmp_path, broken))


def test_elements_of_other_programs_need_no_declared_prefix(tmp_path: Path) -> None:
    text = rail().replace(
        "</robot>",
        '<gazebo><controller:base name="c"><interface:position name="p"/></controller:base>'
        "</gazebo></robot>",
    )
    assert load(saved(tmp_path, text)).driven == ("slide_left", "slide_right")
    xacro = rail().replace("</robot>", '<xacro:unknown name="x"/></robot>')
    with pytest.raises(RobotDescriptionError, match="unbound prefix"):
        load(saved(tmp_path, xacro))


def test_limits_of_followers_that_exclude_each_other_are_left_out_with_a_note(
    tmp_path: Path,
) -> None:
    # A follower in the opposite direction, with the limits of the driven joint.
    text = rail().replace('joint="slide_right"/>', 'joint="slide_right" multiplier="-1"/>')
    text = text.replace('lower="-0.5" upper="0.3"', 'lower="0.1" upper="0.3"')
    robot = load(saved(tmp_path, text))
    joints = robot.joint_group
    assert (joints.lower[1], joints.upper[1]) == (0.1, 0.3)
    (note,) = robot.joint_notes
    assert "follow 'slide_right' exclude each other" in note
    # Limits that only narrow each other count, as before.
    narrow = rail().replace('upper="0.3"', 'upper="0.1"')
    robot = load(saved(tmp_path, narrow.replace('upper="0.1"', 'upper="0.3"', 1)))
    assert robot.joint_group.upper[1] == 0.1
    assert robot.joint_notes == ()


@pytest.mark.parametrize("speed", ['velocity="0"', ""])
def test_an_arm_without_speeds_turns_slowly_and_says_so(tmp_path: Path, speed: str) -> None:
    text = ARM.read_text(encoding="utf-8")
    assert 'velocity="' in text
    start = text.index('velocity="')
    end = text.index('"', start + len('velocity="')) + 1
    path = saved(tmp_path, text[:start] + speed + text[end:])
    robot = load(path)
    arm = robot.require_arm()
    expected = np.array(load(ARM).require_arm().chain.speed)
    expected[0] = SLOW_TURN
    np.testing.assert_array_equal(arm.chain.speed, expected)
    assert any("no speed in its file; it gets 1 rad/s" in note for note in robot.joint_notes)
