"""A UR5e on a server with the scene of viser: its gizmo drives it, and its map is shown."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest

from katana450.cli.main import main
from katana450.client import Client, connect
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer
from tests.gateway.client import Peer, opened
from tests.general_arms.links_of_arms import ur5e

pytestmark = pytest.mark.long


def pose(arm: Client) -> FloatArray:
    return np.array(arm.query(answers.State).T)


async def drag(url: str, T: FloatArray) -> None:
    """Move the gizmo to the place of ``T`` (4, 4), and then turn it."""
    async with opened(url) as (peer, control):
        await control.say("acquire")
        await asyncio.sleep(1.0)
        for name, position, wxyz in (
            ("/target/move", T[:3, 3].tolist(), [1.0, 0.0, 0.0, 0.0]),
            ("/target/move/turn", [0.0, 0.0, 0.0], so3.to_quaternion(T[:3, :3]).tolist()),
        ):
            which = {"name": name, "owner": ""}
            await peer.say(type="TransformControlsDragStartMessage", **which)
            await peer.say(
                type="TransformControlsUpdateMessage", **which, wxyz=wxyz, position=position
            )
            await peer.say(type="TransformControlsDragEndMessage", **which)
            await asyncio.sleep(4.0)
        await control.say("release_lease")


async def show_map(url: str) -> None:
    """Choose the map, and its orientation; each time wait until the points are drawn again."""

    async def choose(peer: Peer, label: str, choice: str) -> None:
        await peer.set(label, value=choice)
        async with asyncio.timeout(30.0):
            while not any(
                message["type"] == "PointCloudMessage" for message in await peer.listen()
            ):
                pass

    async with opened(url) as (peer, control):
        assert peer.controls["Orientation"]["props"]["options"] == ["Any", "As at Home"]
        assert not peer.controls["Orientation"]["props"]["visible"]
        await control.say("acquire")
        await asyncio.sleep(1.0)
        await choose(peer, "Reachability", "Whole")
        await choose(peer, "Orientation", "As at Home")
        await control.say("release_lease")


def test_gizmo_moves_and_turns_the_tool_and_the_map_is_shown(tmp_path: Path) -> None:
    urdf, out = tmp_path / "ur5e.urdf", tmp_path / "map.npz"
    urdf.write_text(ur5e(), encoding="utf-8")
    coarse = ("--voxel", "300", "--pitches", "3", "--rolls", "1", "--out", str(out))
    assert main(["workspace", "--urdf", str(urdf), *coarse]) == 0
    with AppServer((*APP, "--urdf", str(urdf), "--workspace", str(out))) as server:
        with connect(server.url) as arm:
            arm.ask(requests.Home(wait=30))
            T = pose(arm)
            T[:3, 3] += (0.03, 0.0, 0.02)
            T[:3, :3] = T[:3, :3] @ so3.rotation_z(0.3)
            T_base = np.array(arm.query(answers.Arm).T_base_shoulder)
            asyncio.run(drag(server.url, T_base @ T))
            np.testing.assert_allclose(pose(arm), T, atol=1e-5)
        asyncio.run(show_map(server.url))
        assert "Traceback" not in server.output
