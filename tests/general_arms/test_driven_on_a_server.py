"""A UR5e is driven by its tool on a real server: through the API, and by the gizmo of the page."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from katana450.client import Client, connect
from katana450.maths.geometry import so3
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer
from tests.gateway.client import opened
from tests.general_arms.links_of_arms import ur5e

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AppServer]:
    path = tmp_path_factory.mktemp("ur5e") / "ur5e.urdf"
    path.write_text(ur5e(), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(path))) as server:
        yield server


@pytest.fixture
def arm(server: AppServer) -> Iterator[Client]:
    with connect(server.url) as client:
        client.ask(requests.Acquire())
        client.ask(requests.Home(wait=30))
        yield client


def state(client: Client) -> answers.State:
    found = client.ask(requests.Query(at="state"))
    assert isinstance(found, answers.State)
    return found


def rows(matrix: np.ndarray) -> Any:
    return tuple(map(tuple, matrix.tolist()))


def description(client: Client) -> answers.Arm:
    found = client.ask(requests.Query(at="arm"))
    assert isinstance(found, answers.Arm)
    return found


def pose(client: Client) -> np.ndarray:
    return np.array(state(client).T)


def test_pose_position_and_rotation_are_reached(arm: Client) -> None:
    T = pose(arm)
    T[:3, 3] += (0.05, 0.05, -0.05)
    arm.ask(requests.Position(p=tuple(T[:3, 3].tolist()), wait=30))
    np.testing.assert_allclose(pose(arm), T, atol=1e-6)
    T[:3, :3] = so3.exp([0.1, 0.2, -0.1]) @ T[:3, :3]
    arm.ask(requests.Orient(R=rows(T[:3, :3]), wait=30))
    np.testing.assert_allclose(pose(arm), T, atol=1e-6)
    T[:3, 3] += (0.0, -0.1, 0.05)
    arm.ask(requests.Pose(T=rows(T), wait=30))
    np.testing.assert_allclose(pose(arm), T, atol=1e-6)


def test_step_has_six_numbers_and_undo_takes_it_back(arm: Client) -> None:
    T = pose(arm)
    arm.ask(requests.StepTool(by=(0.0, 0.03, 0.0, 0.0, 0.0, 0.1), wait=30))
    moved = pose(arm)
    np.testing.assert_allclose(moved[:3, 3], T[:3, 3] + (0, 0.03, 0), atol=1e-6)
    np.testing.assert_allclose(moved[:3, :3], so3.rotation_z(0.1) @ T[:3, :3], atol=1e-6)
    arm.ask(requests.Undo(wait=30))
    np.testing.assert_allclose(pose(arm), T, atol=1e-6)
    arm.ask(requests.Orient(R=rows(so3.rotation_z(0.2) @ T[:3, :3]), wait=30))
    arm.ask(requests.Undo(wait=30))
    np.testing.assert_allclose(pose(arm), T, atol=1e-6)


def test_branch_is_changed_around_contacts(arm: Client) -> None:
    T = pose(arm)
    found = arm.ask(requests.Query(at="branches"))
    assert isinstance(found, answers.Branches)
    assert len(found.choices) == 8
    now = "-".join(state(arm).branch or ())
    other = next(
        each
        for each in found.choices
        if each.name != now and each.position_error < 1e-6 and each.contact is None
    )
    arm.ask(requests.Branch(name=other.name, wait=60))
    assert "-".join(state(arm).branch or ()) == other.name
    np.testing.assert_allclose(pose(arm), T, atol=1e-6)


def test_gizmo_moves_and_turns_the_tool(server: AppServer, arm: Client) -> None:
    start = pose(arm)
    arm.ask(requests.ReleaseLease())
    wanted = start[:3, 3] + (0.03, 0.0, 0.02)
    turned = start[:3, :3] @ so3.rotation_z(0.3)

    async def drag() -> None:
        async with opened(server.url) as (peer, control):
            await control.say("acquire")
            await asyncio.sleep(1.0)
            T_base = np.array(description(arm).T_base_shoulder)
            place = (T_base[:3, :3] @ wanted + T_base[:3, 3]).tolist()
            wxyz = so3.to_quaternion(T_base[:3, :3] @ turned).tolist()
            for name, position, rotation in (
                ("/target/move", place, [1.0, 0.0, 0.0, 0.0]),
                ("/target/move/turn", [0.0, 0.0, 0.0], wxyz),
            ):
                which = {"name": name, "owner": ""}
                await peer.say(type="TransformControlsDragStartMessage", **which)
                await peer.say(
                    type="TransformControlsUpdateMessage",
                    **which,
                    wxyz=rotation,
                    position=position,
                )
                await peer.say(type="TransformControlsDragEndMessage", **which)
                await asyncio.sleep(4.0)

    asyncio.run(drag())
    reached = pose(arm)
    np.testing.assert_allclose(reached[:3, 3], wanted, atol=1e-5)
    np.testing.assert_allclose(reached[:3, :3], turned, atol=1e-5)
