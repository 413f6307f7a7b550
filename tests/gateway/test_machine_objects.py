"""Robots driven joint by joint: the table and scene objects are obstacles."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.client import Client, RefusedError
from katana450.server.api import answers, requests
from katana450.settings import Settings
from tests.gateway.virtual import VirtualServer
from tests.robot.hands import column

STOP = 0.005
"""[m] Distance that stays to every obstacle."""

SHORT = 0.03
"""[m] Maximum length by which a brake ends earlier: late ticks begin it sooner."""


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory) -> DescribedRobot:
    path = tmp_path_factory.mktemp("column") / "column.urdf"
    path.write_text(column(-0.3))
    return find_robot(Settings(), path, None)


@pytest.fixture
def robot(program: Client) -> Client:
    place(program, "crate", (0.0, 0.2), [0.06, 0.06, 0.08])
    return program


def height(client: Client) -> float:
    """Return the height of the underside of the beam over the table [m]."""
    return client.query(answers.State).q[0] + 0.35 - 0.02


def end(answer: object) -> answers.MotionEnd:
    assert isinstance(answer, answers.Done)
    assert answer.end is not None
    return answer.end


def place(
    client: Client,
    name: str = "block",
    at: tuple[float, float] = (0.2, 0.0),
    size: Sequence[float] = (0.05, 0.05, 0.1),
) -> None:
    """Place a box on the table."""
    T = ((1, 0, 0, at[0]), (0, 1, 0, at[1]), (0, 0, 1, -0.3), (0, 0, 0, 1))
    client.ask(requests.Place(name=name, T=T, shape=requests.Shape.BOX, size=list(size)))


def test_table_is_named_at_the_start_and_stops_a_joint(
    described: DescribedRobot, robot: Client
) -> None:
    assert "The table is 300 mm below the base, under base." in " ".join(described.notes)
    found = end(robot.ask(requests.Joint(axis=1, value=-0.4, wait=30)))
    assert found.how == "contact"
    assert found.why.startswith("Beam and table are ")
    assert STOP - 1e-7 <= height(robot) <= STOP + SHORT


def test_object_is_attached_undone_and_saved_with_the_scene(
    local: VirtualServer, robot: Client
) -> None:
    place(robot, at=(0.2, -0.2))
    robot.ask(requests.Attach(name="block", to=requests.Attachment.TABLE))
    with pytest.raises(RefusedError, match="Nothing can be fixed to a hand: there is no arm"):
        robot.ask(requests.Attach(name="block", to=requests.Attachment.HAND))
    with pytest.raises(RefusedError, match="no cup"):
        robot.ask(requests.Fill(ml=10.0))
    status, _, body = local.ask("/api/v1/scene")
    assert (status, body[:2]) == (200, b"PK")
    robot.ask(requests.Remove(name="block"))
    robot.ask(requests.Undo())
    assert {each.name for each in robot.query(answers.Objects).objects} == {"crate", "block"}
    robot.ask(requests.Remove(name="block"))
