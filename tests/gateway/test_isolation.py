"""What people speak to may crash or freeze: the arm, in a process of its own, stops meanwhile."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from katana450.client import Client, connect
from katana450.client.files import LostError
from katana450.errors import KatanaError
from katana450.server.api import answers, requests
from tests.browser.server import APP, ATTENTIVE_APP, AppServer

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="finds the server's processes as Linux lists them"
)

FAR = np.deg2rad((120.0, -68.0, 85.0, 8.0, 0.0))


@pytest.fixture
def server() -> Iterator[AppServer]:
    with AppServer(APP) as server:
        yield server


def under_way(arm: Client) -> answers.State:
    """Set out for FAR; the state once the arm is on its way."""
    arm.ask(requests.Joints(q=FAR.tolist()))
    while (state := arm.query(answers.State)).q[0] < 0.2:
        assert state.stopped is None
    return state


def again(server: AppServer, seconds: float = 60.0) -> answers.State:
    """What the next front says first."""
    end = time.monotonic() + seconds
    while True:
        # A front that is not quite there yet hangs up, or has no arm yet.
        with suppress(KatanaError, TimeoutError), connect(server.url) as arm:
            return arm.query(answers.State)
        assert time.monotonic() < end, server.output
        time.sleep(0.2)


def test_a_front_that_is_killed_comes_again_and_finds_an_arm_at_rest(server: AppServer) -> None:
    killed = server.front
    with suppress(LostError), connect(server.url, "Driver") as arm:
        before = under_way(arm)
        os.kill(killed, signal.SIGKILL)
        arm.go(requests.Home())
    state = again(server)
    assert server.front != killed
    assert state.stopped == "The arm lost the connection to the server and stopped."
    assert state.status == "stopped"
    assert before.q[0] < state.q[0] < FAR[0] - 0.2
    assert "ended with status -9" in server.output
    with connect(server.url, "Driver") as arm:
        arm.ask(requests.ClearStop())
        time.sleep(0.5)
        assert arm.query(answers.State).q == state.q
        there = arm.joints(np.deg2rad((10.0, -68.0, 85.0, 8.0, 0.0)))
        assert there.status == "ok"


def test_a_front_that_freezes_stops_the_arm_in_time() -> None:
    with AppServer(ATTENTIVE_APP) as server, connect(server.url, "Driver") as arm:
        before = under_way(arm)
        front = server.front
        os.kill(front, signal.SIGSTOP)
        time.sleep(1.5)
        os.kill(front, signal.SIGCONT)
        # What came meanwhile is read first.
        while (state := arm.query(answers.State)).stopped is None:
            time.sleep(0.02)
        # A quarter of a second of silence, and the way it takes to brake.
        assert state.q[0] - before.q[0] < 2.2 * 0.5 + 1.0
        assert state.q[0] < FAR[0] - 0.2
        assert "STOP" in server.output


def test_when_the_arms_process_is_killed_the_other_goes_too(server: AppServer) -> None:
    front = server.front
    os.kill(server.pid, signal.SIGKILL)
    end = time.monotonic() + 10.0
    while Path(f"/proc/{front}").exists() and "Z" not in _state(front):
        assert time.monotonic() < end
        time.sleep(0.05)


def _state(number: int) -> str:
    with suppress(OSError):
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    return "Z"
