"""roslibpy sees the arm, jogs it, follows a trajectory, cancels and stops."""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path

import pytest

from tests.browser.server import AppServer
from tests.commands import completed
from tests.exchange.tools import ROSLIBPY, needs_package
from tests.rosbridge.ros_client import cleared

CLIENT = Path(__file__).with_name("roslibpy_client.py")


@pytest.mark.long
@needs_package(ROSLIBPY)
@pytest.mark.parametrize("transport", ["twisted", "asyncio"])
def test_roslibpy_drives_the_arm(server: AppServer, transport: str) -> None:
    folder = str(ROSLIBPY.folder)
    done = completed(
        [sys.executable, CLIENT, server.url.replace("http", "ws") + "/rosbridge?name=roslibpy"],
        env={"PYTHONPATH": folder, "ROSLIBPY_TRANSPORT": transport},
        seconds=90.0,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    report = json.loads(done.stdout.strip().splitlines()[-1])
    assert {"/joint_states", "/tf", "/robot_description"} <= set(report["topics"])
    assert report["description"].startswith("<?xml")
    status, code, q = report["followed"]
    assert (status, code) == (4, 0)
    assert q == pytest.approx([0.4, -1.1, 1.4, 0.2, 0.3], abs=1e-3)
    assert report["feedback"] >= 10
    status, pan = report["cancelled"]
    assert status == 5
    assert 0.0 < pan < 0.4
    assert report["jogged"] > 0.01
    assert report["stop"] == {"success": True, "message": "requested"}
    status, why = report["stopped"]
    assert status == 5
    assert "roslibpy pressed STOP" in why
    asyncio.run(cleared(server.url))
