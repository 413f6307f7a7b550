"""Clients of rosbridge drive an arm outside the five-axis family by twists."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from katana450.maths.geometry import so3
from tests.browser.server import APP, AppServer
from tests.general_arms.links_of_arms import ur5e
from tests.rosbridge.ros_client import TWIST, ros, twist
from tests.rosbridge.test_motion import stream


@pytest.mark.anyio
@pytest.mark.long
async def test_twist_moves_and_turns_the_tool_of_six_axes(tmp_path: Path) -> None:
    urdf = tmp_path / "ur5e.urdf"
    urdf.write_text(ur5e(), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(urdf))) as server:
        async with ros(server.url) as client:
            before = np.array((await client.state())["T"])
            await stream(client, TWIST, twist(vz=-0.2), 0.8)
            after = np.array((await client.when(lambda state: not state["moving"]))["T"])
            moved = after[:3, 3] - before[:3, 3]
            # 0.2 of 0.4 m/s for 0.8 s, and the path to rest.
            assert -0.15 < moved[2] < -0.02
            assert np.abs(moved[:2]).max() < 0.002
            assert after[:3, :3] == pytest.approx(before[:3, :3], abs=0.005)
            before = after
            await stream(client, TWIST, twist("tool0", wz=0.5, wx=0.5), 0.8)
            after = np.array((await client.when(lambda state: not state["moving"]))["T"])
            turned = so3.log(before[:3, :3].T @ after[:3, :3])
            assert 0.1 < turned[0] < 0.6
            assert turned == pytest.approx([turned[0], 0.0, turned[0]], abs=0.01)
            assert np.abs(after[:3, 3] - before[:3, 3]).max() < 0.002
            # Nothing was refused: neither the twists nor the end of a stream.
            assert not [op for op in client.heard if op["op"] == "status"]
