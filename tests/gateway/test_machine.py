"""Test a mechanism outside the family: its joints move, and it has no tool."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.client import Client, RefusedError
from katana450.maths.geometry import se3
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program
from katana450.settings import Settings
from tests.exchange.trees import tree
from tests.gateway.virtual import VirtualServer
from tests.robot.hands import column

SEED = 5


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("tree") / "tree.urdf"
    file.write_text(tree(SEED))
    return file


@pytest.fixture(scope="module")
def described(path: Path) -> DescribedRobot:
    return find_robot(Settings(), path, None)


@pytest.fixture(scope="module")
def robot(described: DescribedRobot) -> Robot:
    joints = described.robot.joint_group
    assert any(joints.slides)
    assert not all(joints.slides)
    assert len(described.robot.joints) > joints.n
    return described.robot


def test_arm_answer_gives_the_reason_for_joints_only(
    local: VirtualServer, described: DescribedRobot, program: Client, robot: Robot
) -> None:
    description = program.query(answers.Arm)
    assert description.joints == list(robot.joint_group.names)
    assert description.slides == list(robot.joint_group.slides)
    assert (
        description.tools,
        description.default_tool,
        description.gripper,
        description.T_base_shoulder,
    ) == (
        {},
        None,
        None,
        None,
    )
    assert "carries a tool. Its joints are j1 (prismatic)" in description.joints_only
    state = program.query(answers.State)
    assert (state.tool, state.T, state.pitch, state.branch) == (None, None, None, None)
    cartesian: list[requests.Request] = [
        requests.Pose(T=np.eye(4)), requests.Position(p=np.array((0.1, 0, 0))),
        requests.Turn(pitch=0, roll=0), requests.Jog(rates=np.array((0.1, 0, 0, 0, 0))),
        requests.Branch(name="front-up"),
        requests.Gripper(angle=0.1), requests.Tool(name="tcp"), Program(text="steps: []"),
    ]  # fmt: skip
    for request in cartesian:
        with pytest.raises(RefusedError, match=r"Only its joints can be driven\. .*carries a tool"):
            program.ask(request)
    status, _, body = local.ask("/api/v1/branches")
    assert status == 409
    assert "Only its joints" in json.loads(body)["why"]
    with pytest.raises(RefusedError, match=f"no axis {robot.joint_group.n + 1}: the robot has"):
        program.ask(requests.Joint(axis=robot.joint_group.n + 1, value=0.0))
    with pytest.raises(RefusedError, match="driven joints, but the command has 2"):
        program.ask(requests.Joints(q=np.array([0.0, 0.0])))
    assert "Joints only." in described.notes[-1]


@pytest.fixture(scope="module")
def on_table(tmp_path_factory: pytest.TempPathFactory) -> DescribedRobot:
    path = tmp_path_factory.mktemp("column") / "column.urdf"
    path.write_text(column(-0.3))
    return find_robot(Settings(), path, None)


@pytest.fixture
def column_server(on_table: DescribedRobot) -> Iterator[VirtualServer]:
    with VirtualServer(on_table) as server:
        yield server


@pytest.fixture
def column_arm(column_server: VirtualServer) -> Iterator[Client]:
    with column_server.connect("Test") as program:
        place(program, "crate", (0.0, 0.2), [0.06, 0.06, 0.08])
        yield program


def place(
    client: Client,
    name: str = "block",
    position: tuple[float, float] = (0.2, 0.0),
    size: Sequence[float] = (0.05, 0.05, 0.1),
) -> None:
    """Place a box on the table."""
    T = se3.from_rotation_translation(np.eye(3), np.array((*position, -0.3)))
    client.ask(requests.Place(name=name, T=T, shape=requests.Shape.BOX, size=list(size)))


def test_object_is_attached_undone_and_saved_with_the_scene(
    column_server: VirtualServer, column_arm: Client
) -> None:
    place(column_arm, position=(0.2, -0.2))
    column_arm.ask(requests.Attach(name="block", to=requests.Attachment.WORLD))
    with pytest.raises(RefusedError, match="Nothing can be fixed to a hand: there is no arm"):
        column_arm.ask(requests.Attach(name="block", to=requests.Attachment.HAND))
    with pytest.raises(RefusedError, match="no cup"):
        column_arm.ask(requests.Fill(ml=10.0))
    status, _, body = column_server.ask("/api/v1/scene")
    assert (status, body[:2]) == (200, b"PK")
    column_arm.ask(requests.Remove(name="block"))
    column_arm.ask(requests.Undo())
    assert {item.name for item in column_arm.query(answers.Objects).objects} == {"crate", "block"}
    column_arm.ask(requests.Remove(name="block"))
