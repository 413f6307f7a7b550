"""Closed loops in robot descriptions: parallelograms become followers, others are refused."""

from __future__ import annotations

import math
from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.errors import RobotDescriptionError
from katana450.extensions.loops.loop_joints import solve_loops
from katana450.extensions.loops.solved_file import solved_file


def joint(name: str, parent: str, child: str, xyz: str, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
    )


def closing(one: str, other: str, kind: str = "continuous", name: str = "close") -> str:
    """Return the joint that closes a loop; each end is "link:x y z"."""
    ends = "".join(
        f'<link{number} link="{link}" rpy="0 0 0" xyz="{at}"/>'
        for number, (link, at) in enumerate((each.split(":") for each in (one, other)), 1)
    )
    return f'<loop_joint name="{name}" type="{kind}"><axis xyz="0 1 0"/>{ends}</loop_joint>'


def four_bar(width: float = 0.2, closed_at: float = 0.2, kind: str = "continuous") -> str:
    """Return two upright bars of 0.3 m on a base, with a bar between their ends."""
    links = "".join(f'<link name="{name}"/>' for name in ("base", "left", "right", "top", "tool"))
    return (
        f'<robot name="bars">{links}'
        + joint("a", "base", "left", "0 0 0")
        + joint("b", "base", "right", f"{width} 0 0")
        + joint("c", "left", "top", "0 0 0.3")
        + '<joint name="d" type="fixed"><parent link="top"/><child link="tool"/>'
        '<origin xyz="0.1 0 0.05"/></joint>'
        + closing(f"top:{closed_at} 0 0", "right:0 0 0.3", kind)
        + "</robot>"
    )


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "bars.urdf"
    path.write_text(text)
    return path


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "cache"))


def gap(robot: Robot, value: float, closed_at: float = 0.2) -> float:
    """Return how far the loop is open with the driven joint at ``value`` [m]."""
    frames = robot.frames(robot.every({"a": value}))
    one = frames["top"] @ (closed_at, 0.0, 0.0, 1.0)
    other = frames["right"] @ (0.0, 0.0, 0.3, 1.0)
    return float(np.linalg.norm(one - other))


@pytest.mark.parametrize("kind", ["continuous", "revolute", "spherical"])
def test_a_parallelogram_is_a_tree_with_followers(tmp_path: Path, kind: str) -> None:
    robot = load(solved_file(write(tmp_path, four_bar(kind=kind))))
    assert robot.driven == ("a",)
    following = {name: (each.leader, each.factor) for name, each in robot.joints.items()}
    assert following == {"a": ("a", 1.0), "b": ("a", 1.0), "c": ("a", -1.0)}
    for value in np.linspace(-1.0, 1.0, 21).tolist():
        assert gap(robot, value) < 1e-12
        # The tool keeps its direction, as on every parallelogram.
        tool = robot.frames(robot.every({"a": value}))["tool"]
        np.testing.assert_allclose(tool[:3, :3], np.eye(3), atol=1e-12)
        expected = (0.3 * math.sin(value) + 0.1, 0.0, 0.3 * math.cos(value) + 0.05)
        np.testing.assert_allclose(tool[:3, 3], expected, atol=1e-12)


def test_a_file_whose_zero_is_open_gets_offsets(tmp_path: Path) -> None:
    # The zero of the right bar is turned by 0.2 rad against that of the left one.
    text = four_bar().replace('<origin xyz="0.2 0 0"/>', '<origin xyz="0.2 0 0" rpy="0 0.2 0"/>', 1)
    robot = load(solved_file(write(tmp_path, text)))
    assert gap(robot, 0.0) < 1e-9
    assert gap(robot, 0.7) < 1e-9
    assert robot.joints["b"].offset == pytest.approx(-0.2, abs=0.2)
    assert robot.joints["b"].offset != 0.0


def test_a_four_bar_that_is_no_parallelogram_is_refused_with_its_loop(tmp_path: Path) -> None:
    path = write(tmp_path, four_bar(width=0.25, closed_at=0.15))
    with pytest.raises(
        RobotDescriptionError, match="closed loop of 'close' with the joints a, b, c"
    ):
        solved_file(path)


def test_a_loop_that_cannot_be_closed_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, four_bar(width=2.0))
    with pytest.raises(RobotDescriptionError, match=r"'close' .* cannot be closed"):
        solved_file(path)


def test_two_drivers_in_one_loop_are_refused(tmp_path: Path) -> None:
    # A five-bar: both bars on the base can be driven.
    text = four_bar().replace("</robot>", "")
    text = text.replace('type="fixed"', 'type="revolute"').replace(
        '<origin xyz="0.1 0 0.05"/></joint>',
        '<origin xyz="0.1 0 0.05"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>',
    )
    text = text.replace("top:", "tool:").replace('link="top" rpy', 'link="tool" rpy')
    text = text.replace('xyz="0.2 0 0"/><link2', 'xyz="0.1 0 -0.05"/><link2')
    with pytest.raises(RobotDescriptionError, match="'close' with the joints a, b, c, d"):
        solved_file(write(tmp_path, text + "</robot>"))


def test_each_of_two_separate_loops_is_solved_and_the_bad_one_is_named(tmp_path: Path) -> None:
    second = "".join(f'<link name="{name}2"/>' for name in ("left", "right", "top"))
    second += joint("a2", "base", "left2", "0 1 0") + joint("b2", "base", "right2", "0.2 1 0")
    second += joint("c2", "left2", "top2", "0 0 0.3")
    good = closing("top2:0.2 0 0", "right2:0 0 0.3", name="second")
    text = four_bar().replace("</robot>", second)
    robot = load(solved_file(write(tmp_path, text + good + "</robot>")))
    assert robot.driven == ("a", "a2")
    bad = closing("top2:0.1 0 0", "right2:0 0 0.25", name="second")
    with pytest.raises(RobotDescriptionError, match="loop of 'second' with the joints a2, b2, c2"):
        solved_file(write(tmp_path, text + bad + "</robot>"))


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('type="continuous"><axis', 'type="prismatic"><axis', "of the type 'prismatic'"),
        ('<link2 link="right"', '<link2 link="nothing"', "two links of the robot"),
        ('<link2 link="right" rpy="0 0 0"', '<link2 link="right" rpy="0 0"', "3 finite numbers"),
        ('<axis xyz="0 1 0"/><link1', '<axis xyz="0 0 0"/><link1', "has no axis"),
        ('<axis xyz="0 1 0"/><link1', '<axis xyz="x y z"/><link1', "3 finite numbers"),
    ],
)
def test_a_broken_loop_is_refused(tmp_path: Path, old: str, new: str, problem: str) -> None:
    text = four_bar()
    assert old in text
    with pytest.raises(RobotDescriptionError, match=f"<loop_joint> 'close'.*{problem}"):
        solved_file(write(tmp_path, text.replace(old, new)))


def test_meshes_keep_their_files(tmp_path: Path) -> None:
    (tmp_path / "bar.stl").write_bytes(b"")
    text = four_bar().replace(
        '<link name="left"/>',
        '<link name="left"><visual><geometry><mesh filename="bar.stl"/></geometry></visual></link>',
    )
    robot = load(solved_file(write(tmp_path, text)))
    (visual,) = next(link for link in robot.links if link.name == "left").visuals
    assert visual.source == (tmp_path / "bar.stl").resolve()


def test_commands_solve_the_loops_of_their_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, four_bar())
    options = Namespace(urdf=path)
    solve_loops(options)
    assert load(options.urdf).driven == ("a",)
    plain = Namespace(urdf=tmp_path / "missing.urdf")
    solve_loops(plain)
    assert plain.urdf == tmp_path / "missing.urdf"
    bad = write(tmp_path, four_bar(width=0.25, closed_at=0.15))
    assert main(["serve", "--port", "0", "--urdf", str(bad)]) == 1
    assert "closed loop of 'close'" in capsys.readouterr().err


def test_readers_that_solve_no_loop_refuse_it(tmp_path: Path) -> None:
    path = write(tmp_path, four_bar())
    with pytest.raises(RobotDescriptionError, match=r"closed loop .*<loop_joint 'close'>"):
        load(path)
