"""Robots of which shapes are missing or look wrong: estimated contacts, and what drivers read."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.messages import UNCHECKED
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.settings import Settings
from tests.general_arms.driven import begun, settled
from tests.general_arms.links_of_arms import ur5e
from tests.robot.hands import column
from tests.robot.urdf_files import saved

SHAPE = re.compile(r"<(cylinder|box) [^>]*/>")
ESTIMATED = "Contacts are estimated, because shapes cannot be read:"
MISSING = '<mesh filename="package://ur/none.stl"/>'


def read(tmp_path: Path, text: str) -> DescribedRobot:
    return find_robot(Settings(), saved(tmp_path, text), None)


def test_arm_without_its_meshes_stops_before_the_table_and_says_what_is_estimated(
    tmp_path: Path,
) -> None:
    robot, session, notes = read(tmp_path, SHAPE.sub(MISSING, ur5e()))
    assert robot.cautions == (
        "Not checked for contacts: shoulder, wrist_3.",
        f"{ESTIMATED} base_link, upper_arm, forearm, wrist_1, wrist_2.",
    )
    assert set(robot.cautions) <= set(notes)
    for elbow in (0.0, 1.0):
        state = settled(session, begun(session), [cmd.Joint(2, -np.pi / 2.0)])
        state = settled(session, state, [cmd.Joint(3, elbow)])
        state = settled(session, state, [cmd.Joint(2, 0.7)])
        frames = robot.frames(robot.joint_values(state.q, 0.0))
        lowest = min(frames[name][2, 3] for name in ("forearm", "wrist_1", "wrist_2", "wrist_3"))
        assert state.q[1] < 0.69
        assert 0.03 < lowest < 0.1
        (finding,) = state.findings
        assert finding.parts is not None
        assert finding.parts[1] == "table"


@pytest.mark.parametrize(
    ("lost", "dropped", "estimated"),
    [
        ("visual|collision", "", True),
        # What is drawn replaces a collision shape, and without one a drawing is not needed.
        ("collision", "", False),
        ("visual", "", False),
        ("visual", "collision", True),
    ],
)
@pytest.mark.parametrize("mesh", ["none.stl", "bad.stl"])
def test_only_a_link_of_unknown_shape_is_estimated(
    tmp_path: Path, lost: str, dropped: str, mesh: str, estimated: bool
) -> None:
    if mesh == "bad.stl" and lost == "collision":
        # A file that cannot be read was checked for contacts, so its link is estimated.
        estimated = True
    (tmp_path / "bad.stl").write_bytes(b"no mesh")
    text = re.sub("<collision>.*?</collision>", "", ur5e()) if dropped else ur5e()
    forearm = re.search('<link name="forearm">.*?</link>', text)
    assert forearm is not None
    replaced = re.sub(
        f"<({lost})>.*?</({lost})>",
        lambda shape: SHAPE.sub(f'<mesh filename="{mesh}"/>', shape[0]),
        forearm[0],
    )
    robot, session, _ = read(tmp_path, text.replace(forearm[0], replaced))
    assert robot.cautions == (f"{ESTIMATED} forearm.",) * estimated
    assert session.world is not None
    assert "forearm" in [part.name for part in session.world.parts]


def test_mechanism_without_its_meshes_keeps_its_table(tmp_path: Path) -> None:
    robot, session, _ = read(tmp_path, SHAPE.sub(MISSING, column()))
    assert robot.cautions == (
        "Not checked for contacts: beam.",
        f"{ESTIMATED} base.",
    )
    assert session.world is not None
    (table,) = (part for part in session.world.parts if part.name == "table")
    assert table.T_mover_shape[0][2, 3] == 0.0


def test_robot_that_names_no_shapes_is_not_checked(tmp_path: Path) -> None:
    bare = re.sub("<(visual|collision)>.*?</(visual|collision)>", "", ur5e())
    robot, session, notes = read(tmp_path, bare)
    assert robot.cautions == (UNCHECKED,)
    assert session.world is None
    assert UNCHECKED in notes


def test_sizes_and_places_that_look_wrong_are_named(tmp_path: Path) -> None:
    large = ur5e().replace('radius="0.037" length="0.06"', 'radius="37" length="60"')
    robot, _, _ = read(tmp_path, large)
    assert robot.cautions == ("wrist_3 is 74 m long: check the unit of its shapes.",)
    deep = ur5e().replace('xyz="-0.196 0.0 0.007"', 'xyz="0 4 0"')
    robot, _, _ = read(tmp_path, deep)
    (overlap,) = robot.cautions
    assert re.match(r"forearm and table overlap by \d+ mm where the robot starts", overlap)
    far = ur5e().replace('xyz="-0.425 0.0', 'xyz="-425.0 0.0').replace('xyz="-0.425', 'xyz="-425.0')
    robot, _, _ = read(tmp_path, far)
    assert robot.cautions == (
        "forearm is 425 m from its parent upper_arm: check the origin of its joint.",
    )
