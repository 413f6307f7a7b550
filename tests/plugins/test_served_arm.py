"""The plug-ins for LeRobot, as far as they need no LeRobot, with a real server."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from runpy import run_path
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

from katana450.client import Client, RefusedError, connect
from katana450.client.files import LostError
from katana450.errors import InputError
from katana450.server.api import answers, requests
from tests.browser.server import ROOT, AppServer
from tests.waiting import state_when

FILE = ROOT / "plugins" / "lerobot_robot_katana450" / "lerobot_robot_katana450" / "served_arm.py"

PLUGIN = SimpleNamespace(**run_path(str(FILE)))
"""The module without the package around it, which needs LeRobot."""


@pytest.fixture
def ada(plain_server: AppServer) -> Iterator[Client]:
    with connect(plain_server.url, "Ada") as client:
        client.clear_stop()
        yield client


@pytest.fixture
def arm(plain_server: AppServer) -> Iterator[Any]:
    arm = PLUGIN.ServedArm(PLUGIN.ServerOptions(url=plain_server.url), PLUGIN.ROBOT_NAME)
    arm.open()
    yield arm
    arm.close()


def test_numbers_have_the_names_and_units_of_datasets_or_of_an_so101(ada: Client) -> None:
    arm = ada.query(answers.Arm)
    assert arm.gripper is not None
    closed, opened, _ = arm.gripper
    joints = np.array([*(0.5 * (np.array(arm.lower) + arm.upper)), opened])
    own = PLUGIN.JointFeatures(arm, use_degrees=False)
    assert own.names == (*(f"theta{axis}.pos" for axis in range(1, 6)), "gripper.pos")
    assert list(own.numbers(joints).values()) == joints.tolist()
    names = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
    other = PLUGIN.JointFeatures(msgspec.structs.replace(arm, joints=names), use_degrees=True)
    roll = math.degrees(joints[4])
    expected = dict(zip(other.names, (0.0, 0.0, 0.0, 0.0, roll, 100.0), strict=True))
    assert other.numbers(joints) == pytest.approx(expected, abs=1e-9)
    beyond = dict.fromkeys(other.names, 1000.0)
    assert other.joints(beyond) == pytest.approx([*arm.upper, max(closed, opened)])
    with pytest.raises(InputError, match=r"The action has no shoulder_pan\.pos"):
        other.joints(own.numbers(joints))


def test_arm_follows_actions_until_it_is_stopped(arm: Any, ada: Client) -> None:
    ada.release_lease()
    arm.drive()
    start = arm.measured()
    goal = start | {"theta1.pos": start["theta1.pos"] + 0.2}
    for _ in range(60):
        assert arm.follow(goal) == goal
        time.sleep(0.02)
    assert arm.measured() == pytest.approx(goal, abs=1e-3)
    with pytest.raises(InputError, match=r"Add --robot\.drive=false"):
        arm.setpoint(0.0)
    ada.stop()
    with pytest.raises(RefusedError, match=r"was stopped: Ada .* no longer drives it"):
        arm.measured()
    arm.close()
    arm.open()
    with pytest.raises(RefusedError, match=r"is stopped: Ada .* Clear the stop"):
        arm.drive()


def test_setpoints_of_another_driver_are_actions_ahead_of_time(arm: Any, ada: Client) -> None:
    with pytest.raises(RefusedError, match=r"Ada holds the arm.* --robot.drive=false"):
        arm.drive()
    first, *others = ada.query(answers.State).setpoint
    ada.ask(requests.Joints(q=np.array([first + 0.3, *others])))
    state_when(ada, lambda state: abs(state.qd[0]) > 0.1)
    now, later = arm.setpoint(0.0), arm.setpoint(0.1)
    assert later["theta1.pos"] > now["theta1.pos"]
    state_when(ada, lambda state: not state.moving)
    assert arm.setpoint(0.1) == arm.measured()


def test_lost_server_is_an_error(arm: Any) -> None:
    arm.close()
    with pytest.raises(LostError, match="no connection"):
        arm.measured()
    absent = PLUGIN.ServedArm(PLUGIN.ServerOptions(url="http://127.0.0.1:9"), "LeRobot")
    with pytest.raises(LostError, match="There is no katana450 server"):
        absent.open()
