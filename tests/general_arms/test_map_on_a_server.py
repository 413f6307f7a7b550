"""A map of a UR5e is made by the command and shown by the server of that arm."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from katana450.cli.main import main
from tests.browser.server import APP, AppServer
from tests.gateway.client import Peer, opened
from tests.general_arms.links_of_arms import ur5e

pytestmark = pytest.mark.long


def test_map_is_shown_with_the_orientation_of_home(tmp_path: Path) -> None:
    urdf, out = tmp_path / "ur5e.urdf", tmp_path / "map.npz"
    urdf.write_text(ur5e(), encoding="utf-8")
    coarse = ("--voxel", "300", "--pitches", "3", "--rolls", "1", "--out", str(out))
    assert main(["workspace", "--urdf", str(urdf), *coarse]) == 0

    async def choose(peer: Peer, label: str, choice: str) -> None:
        """Change a control, and wait until the points are drawn again."""
        await peer.set(label, value=choice)
        async with asyncio.timeout(30.0):
            while not any(each["type"] == "PointCloudMessage" for each in await peer.listen()):
                pass

    async def act(url: str) -> None:
        async with opened(url) as (peer, control):
            assert peer.controls["Orientation"]["props"]["options"] == ["Any", "As at Home"]
            assert not peer.controls["Orientation"]["props"]["visible"]
            await control.say("acquire")
            await asyncio.sleep(1.0)
            await choose(peer, "Reachability", "Whole")
            await choose(peer, "Orientation", "As at Home")
            await control.say("release_lease")

    with AppServer((*APP, "--urdf", str(urdf), "--workspace", str(out))) as server:
        asyncio.run(act(server.url))
        assert "Traceback" not in server.output
