"""Test a frozen process of the arm, and one without a control loop: reported and stopped."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from katana450.client import Client, connect
from katana450.client.files import LostError
from katana450.errors import KatanaError
from katana450.server.api import answers, requests
from tests.browser.server import APP, ATTENTIVE_APP, AppServer
from tests.gateway.client import ask
from tests.gateway.lines import speaking
from tests.gateway.postures import FAR

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="finds the server's processes as Linux lists them"
)


def state_of(server: AppServer) -> dict[str, object]:
    state: dict[str, object] = json.loads(ask(f"{server.url}/api/v1/state")[2])
    return state


def test_arm_that_was_frozen_rests_and_waits_for_clear_stop() -> None:
    command = (*ATTENTIVE_APP, "--silence", "0.6", "--lines", "0")
    with AppServer(command) as server, speaking(server, "Driver") as driver:
        driver.say(do="joints", q=FAR.tolist())
        end = time.monotonic() + 20.0
        while driver.answer(do="query")["q"][0] < 0.2:
            assert time.monotonic() < end
            time.sleep(0.02)
        with server.frozen(server.arm):
            end = time.monotonic() + 10.0
            while state_of(server)["stopped"] is None:
                driver.say(do="heartbeat")
                assert time.monotonic() < end
                time.sleep(0.1)
            refused = driver.answer(do="clear_stop")
            assert "has not answered" in refused["why"]
        assert "did not answer" in str(state_of(server)["stopped"])
        end = time.monotonic() + 5.0
        while (state := state_of(server))["stop"] != "confirmed" or state["moving"]:
            assert time.monotonic() < end
            time.sleep(0.05)
        assert driver.clear_stop()["is"] == "done"
        time.sleep(0.5)
        np.testing.assert_array_equal(state_of(server)["q"], state["q"])


def under_way(arm: Client) -> answers.State:
    """Start a motion to FAR; return the state once the arm moves."""
    arm.ask(requests.Joints(q=FAR))
    end = time.monotonic() + 20.0
    while (state := arm.query(answers.State)).q[0] < 0.2:
        assert state.stopped is None
        assert time.monotonic() < end
        # A client that asks without pause is taken for a flood.
        time.sleep(0.01)
    return state


def again(server: AppServer, seconds: float = 60.0) -> answers.State:
    """Return the first state of the restarted front end."""
    end = time.monotonic() + seconds
    while True:
        # A front end that is still starting closes connections, or has no arm yet.
        with suppress(KatanaError, TimeoutError), connect(server.url) as arm:
            return arm.query(answers.State)
        assert time.monotonic() < end, server.output
        time.sleep(0.2)


def test_killed_front_end_is_restarted_with_an_arm_at_rest() -> None:
    with AppServer(APP) as server:
        check_restart(server)


def check_restart(server: AppServer) -> None:
    killed = server.front
    with suppress(LostError), connect(server.url, "Driver") as arm:
        before = under_way(arm)
        # Once somebody drives, everything has started.
        check_priorities(server)
        os.kill(killed, signal.SIGKILL)
        arm.go(requests.Home())
    state = again(server)
    assert server.front != killed
    assert state.stopped == "The arm lost the connection to the server and stopped."
    assert state.status == "stopped"
    assert before.q[0] < state.q[0] < FAR[0] - 0.2
    assert "ended with status -9" in server.output
    with connect(server.url, "Driver") as arm:
        arm.clear_stop()
        time.sleep(0.5)
        assert arm.query(answers.State).q == state.q
        there = arm.joints(np.deg2rad((10.0, -68.0, 85.0, 8.0, 0.0)))
        assert there.status == "ok"


def may_have_real_time() -> bool:
    """Return whether the system lets a process of this user have a real-time priority."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except PermissionError:
        return False
    os.sched_setscheduler(0, *before)
    return True


def check_priorities(server: AppServer) -> None:
    """Check that the threads of control and STOP preempt everything."""
    threads = [int(task.name) for task in Path(f"/proc/{server.arm}/task").iterdir()]
    policies = [os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK for thread in threads]
    # The control thread, and the one that takes STOP. All others can wait.
    assert policies.count(os.SCHED_RR) == (2 if may_have_real_time() else 0)
    assert policies.count(os.SCHED_OTHER) == len(policies) - policies.count(os.SCHED_RR)
    others = Path(f"/proc/{server.arm}/task").glob("*/children")
    for process in [
        server.front,
        server.stop_process,
        *" ".join(p.read_text() for p in others).split(),
    ]:
        for task in Path(f"/proc/{process}/task").iterdir():
            assert os.sched_getscheduler(int(task.name)) == os.SCHED_OTHER


def process_state(number: int) -> str:
    with suppress(OSError):
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    return "Z"
