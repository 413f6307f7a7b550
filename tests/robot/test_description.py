"""Faults of a URDF file are reported with file and line, and never as an exception of Python."""

from __future__ import annotations

from pathlib import Path

import pytest

from katana450.arm.robot.loader import load
from katana450.assembly.robot_session import find_robot
from katana450.errors import RobotDescriptionError
from katana450.settings import Settings
from tests.robot.public_arms import PX150, J, urdf, written
from tests.robot.urdf_files import edited


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "</robot>",
            '<loop_joint name="bar" type="revolute"/></robot>',
            r"line \d+: <loop_joint> 'bar' closes a loop .* <mimic>",
        ),
        ('xyz="0.05 0.0 0.15"', 'xyz="${a} 0 0"', r"line \d+: .* 'a' is not defined"),
        (
            '<link name="base"/>',
            '<xacro:arm xmlns:xacro="http://ros.org/wiki/xacro"/>',
            "unknown macro name",
        ),
        (
            'xyz="0.05 0.0 0.15"',
            'xyz="0.05 0.0"',
            r"line \d+: xyz='0.05 0.0' .*'elbow' .* 3 finite",
        ),
        ('xyz="0.05 0.0 0.15"', 'xyz="5cm 0 0"', "xyz='5cm 0 0' .*must be 3 finite numbers"),
        ('lower="-2.0"', 'lower="low"', "lower='low' of the <limit> of <joint> .* a finite number"),
        ('<parent link="upper"/>', '<parent link="uper"/>', r"parent of joint 'elbow' is 'uper'"),
        ('<child link="fore"/>', '<child link="for"/>', r"child of joint 'elbow' is 'for', but"),
        ('<parent link="upper"/>', "", r"joint 'elbow' has no <parent>"),
        ('<parent link="upper"/>', "<parent/>", r"the <parent> of <joint> 'elbow' has no 'link'"),
        ('name="elbow" type="revolute"', 'name="elbow"', r"the <joint> 'elbow' has no 'type'"),
        ('name="elbow" type="revolute"', 'name="elbow" type="hinge"', "of the type 'hinge'; known"),
        ('name="elbow"', 'name="waist"', r"there is a joint 'waist' in line \d+ already"),
        ('<link name="upper"/>', '<link name="upper"/><link name="upper"/>', "a link 'upper' in"),
        (
            '<link name="upper"/>',
            '<link name="upper"/><link name="alone"/>',
            r"not 2 \(base, alone",
        ),
        (
            '<link name="upper"/>',
            '<link name="upper"><visual><geometry><cone r="1"/></geometry></visual></link>',
            "the shape of the <visual> of <link> 'upper' is <cone>; known are box",
        ),
        (
            '<link name="upper"/>',
            '<link name="upper"><collision><origin/></collision></link>',
            "<collision> of <link> 'upper' has no shape",
        ),
        (
            '<link name="upper"/>',
            '<link name="upper"><visual><geometry><box size="1 1"/></geometry></visual></link>',
            "size='1 1' of the <box> of <link> 'upper' must be 3 finite numbers",
        ),
        (
            '<link name="upper"/>',
            '<link name="upper"><inertial><mass value="heavy"/></inertial></link>',
            "value='heavy' of the <mass> of <link> 'upper' must be a finite number",
        ),
    ],
)
def test_every_fault_of_a_file_is_reported_with_its_line(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    path = edited(tmp_path, urdf("arm", PX150), old, new)
    with pytest.raises(RobotDescriptionError, match=expected) as raised:
        find_robot(Settings(), path, None)
    message = str(raised.value)
    assert "arm.urdf" in message
    for words in ("list.remove", "could not convert", "NoneType", "KeyError", "invalid literal"):
        assert words not in message


def test_a_fault_that_only_the_reader_finds_is_reported_plainly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ValueError("list.remove(x): x not in list")

    monkeypatch.setattr("katana450.arm.robot.loader.urdf_of", fail)
    path = written(tmp_path, "arm", PX150)
    with pytest.raises(
        RobotDescriptionError, match=r"arm.urdf cannot be read .*check_urdf"
    ) as raised:
        load(path)
    assert "list.remove" not in str(raised.value)


def test_a_ring_of_followers_names_the_joint_that_is_followed(tmp_path: Path) -> None:
    jaws = [
        J(name, "prismatic", "base", f"{name}_link", mimic=(other, 1.0))
        for name, other in (("left", "right"), ("right", "left"))
    ]
    (fault, _) = load(written(tmp_path, "arm", [*PX150, *jaws])).faults
    assert fault.startswith("Joint 'left' of arm.urdf mimics 'right', which is not driven")
