"""Test killed and frozen processes of a server: each is started again, and nothing moves by itself.

The supervisor is the process of the command itself; the others are its children.
"""

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

from katana450.arm.control.state.scene_objects import Shape
from katana450.client import Client, connect
from katana450.client.files import LostError, RefusedError
from katana450.errors import KatanaError
from katana450.server.api import answers, requests
from tests.browser.server import APP, ATTENTIVE_APP, AppServer, ServerError
from tests.gateway.client import ask, healthy, state_of
from tests.gateway.postures import FAR
from tests.waiting import until

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="finds the server's processes as Linux lists them"
)

NEAR = np.deg2rad((-120.0, -68.0, 85.0, 8.0, 0.0))

POST = "#VRML V2.0 utf8\nShape { geometry Box { size 0.04 0.04 0.1 } }"

FATES = [
    ("arm", signal.SIGKILL),
    pytest.param("arm", signal.SIGSTOP, marks=pytest.mark.long),
    ("front", signal.SIGKILL),
    pytest.param("front", signal.SIGSTOP, marks=pytest.mark.long),
]


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer(APP) as server:
        yield server


PATIENT = 90.0
"""[s] Timeout for a new process on a machine that others keep busy."""


def strike(server: AppServer, process: str, number: signal.Signals) -> None:
    """Send ``number`` to ``process`` during a motion, and check what follows."""
    victim = server.child(f"katana450 {process}")

    def replaced() -> bool:
        with suppress(ServerError):
            return server.child(f"katana450 {process}") != victim
        return False

    with lost_connection(), connect(server.url, "Driver") as arm:
        arm.clear_stop()
        start = arm.query(answers.State).q[0]
        goal = NEAR if start > 0.0 else FAR
        arm.ask(requests.Joints(q=goal))
        time.sleep(0.4)
        before = arm.query(answers.State)
        os.kill(victim, number)
        struck = time.monotonic()
        # An arm that does not answer is reported, unless it is replaced before anybody misses it; a
        # front end that is lost disconnects its clients.
        while process == "front" or (healthy(server) and not replaced()):
            assert time.monotonic() < struck + 20.0
            arm.query(answers.State)
    until(lambda: healthy(server), PATIENT)
    assert server.child(f"katana450 {process}") != victim
    until(lambda: state_of(server)["stop"] == "confirmed" and not state_of(server)["moving"], 5.0)
    state = state_of(server)
    assert state["status"] == "stopped"
    q = state["q"]
    # The arm stands near its last known place, and has not reached its goal.
    assert abs(q[0] - before.q[0]) < 1.5
    with connect(server.url, "Driver") as arm:
        with pytest.raises(RefusedError, match="stop"):
            arm.ask(requests.Joints(q=goal))
        arm.clear_stop()
        time.sleep(0.3)
        assert arm.query(answers.State).q == q
        angle = q[0] + (0.1 if q[0] < 0.0 else -0.1)
        assert arm.joints([angle, *q[1:]]).q[0] == pytest.approx(angle)


def lost_connection() -> suppress:
    """Return a context in which the server may close the connection."""
    return suppress(LostError, TimeoutError)


@pytest.mark.parametrize(("process", "number"), FATES)
def test_lost_process_is_started_again_with_a_stopped_arm(
    server: AppServer, process: str, number: signal.Signals
) -> None:
    strike(server, process, number)
    title = "The arm's process" if process == "arm" else "The page's server"
    assert f"{title} ended with status -9 and is started again" in server.output


def test_new_process_of_the_arm_keeps_scene_lease_and_front_end(server: AppServer) -> None:
    front, killed = server.front, server.arm
    with connect(server.url, "Driver") as arm:
        arm.clear_stop()
        arm.ask(requests.Place(name="block", shape=Shape.BOX, size=[0.05, 0.05, 0.05]))
        arm.joints(np.deg2rad((30.0, -68.0, 85.0, 8.0, 0.0)))
        before = arm.query(answers.State)
        # The supervisor gets each state a moment later.
        time.sleep(0.3)
        os.kill(killed, signal.SIGKILL)
        until(lambda: not healthy(server), 5.0)
        until(lambda: healthy(server), PATIENT)
        until(lambda: state_of(server)["stop"] == "confirmed", 5.0)
        after = arm.query(answers.State)
        assert (after.q, after.gripper, after.holder) == (before.q, before.gripper, before.holder)
        assert after.status == "stopped"
        assert "started again" in str(after.stopped)
        assert "block" in ask(f"{server.url}/api/v1/objects")[2].decode()
        assert server.front == front
        assert server.arm != killed
        assert "restarted" in [finding.reason for finding in after.findings]
        arm.clear_stop()
        arm.ask(requests.ReleaseLease())


@pytest.mark.long
def test_uploaded_mesh_outlasts_the_front_end(server: AppServer, tmp_path: Path) -> None:
    (tmp_path / "post.wrl").write_text(POST, encoding="utf-8")
    killed = server.front
    with connect(server.url, "Driver") as arm:
        mesh = arm.upload(tmp_path / "post.wrl")
        arm.ask(requests.Place(name="post", shape=Shape.MESH, mesh=mesh.key))
        # The file is written beside the server's thread.
        time.sleep(0.5)
        with lost_connection():
            os.kill(killed, signal.SIGKILL)
            for _ in range(100_000):
                arm.query(answers.State)
    until(lambda: healthy(server), PATIENT)
    with connect(server.url, "Driver") as arm:
        # Only a mesh with its triangles can be saved.
        assert mesh.key.encode() in arm.save_scene() or b".wrl" in arm.save_scene()
        arm.clear_stop()
        arm.ask(requests.Remove(name="post"))
        arm.ask(requests.ReleaseLease())


def test_arm_obeys_while_the_supervisor_is_frozen(server: AppServer) -> None:
    os.kill(server.pid, signal.SIGSTOP)
    try:
        time.sleep(1.5)
        with connect(server.url, "Driver") as arm:
            arm.clear_stop()
            q = arm.query(answers.State).q
            arm.joints([q[0], *q[1:4], q[4] + 0.1])
    finally:
        os.kill(server.pid, signal.SIGCONT)
    until(lambda: healthy(server), 5.0)
    # A supervisor that was frozen does not take its own pause for silence of the processes.
    assert state_of(server)["stopped"] is None


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
def test_no_process_outlives_the_supervisor(number: signal.Signals) -> None:
    with AppServer(ATTENTIVE_APP) as server:
        others = [server.arm, server.front, server.stop_process]
        with suppress(KatanaError, OSError), connect(server.url, "Driver") as arm:
            arm.ask(requests.Joints(q=FAR))
            time.sleep(0.3)
            os.kill(server.pid, number)
            until(lambda: all(process_state(process) == "Z" for process in others), 10.0)
        assert all(process_state(process) == "Z" for process in others)


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


def may_have_real_time() -> bool:
    """Return whether the system lets a process of this user have a real-time priority."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except PermissionError:
        return False
    os.sched_setscheduler(0, *before)
    return True


def test_threads_of_control_and_stop_preempt_everything(server: AppServer) -> None:
    # Once somebody drives, everything has started.
    with connect(server.url, "Driver") as arm:
        arm.clear_stop()
        arm.go(requests.Home())
        arm.ask(requests.ReleaseLease())
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
