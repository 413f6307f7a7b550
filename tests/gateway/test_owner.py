"""Test the owner of a program: websocket, HTTP and the sockets of a page."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import pytest

from katana450.client import Client
from katana450.server.api import answers
from tests.gateway.virtual import VirtualServer

LINES = "".join(f"  - line: {{by: {{z: {z}}}}}\n" for z in (20, -20))
SWEEPS = "".join(f"  - joints: [{angle}, -64, 85, 8, 0]\n" for angle in (60, -60, 50, -50, 40, -40))
LONG = f"name: Long\ntool: tcp\nsteps:\n{SWEEPS}{LINES * 6}  - home\n"
"""A script that takes a second or more to plan, and begins with a long motion."""


@pytest.fixture
def arm(local: VirtualServer) -> Iterator[Client]:
    """Connect a program as owner."""
    with local.connect("Owner") as arm:
        yield arm


def wait(
    arm: Client, until: Callable[[answers.State], bool], seconds: float = 40.0
) -> answers.State:
    due = time.monotonic() + seconds
    while not until(state := arm.query(answers.State)):
        assert time.monotonic() < due, (state.program, state.why)
        time.sleep(0.01)
    return state


def status(state: answers.State) -> str:
    return "" if state.program is None else state.program.status


def stays(arm: Client, seconds: float = 1.0) -> None:
    """Check that the arm does not move for ``seconds``."""
    before = arm.query(answers.State)
    time.sleep(seconds)
    after = arm.query(answers.State)
    assert after.q == before.q
    assert not after.moving


def test_pause_during_planning_over_http(local: VirtualServer, arm: Client) -> None:
    for at in range(0, len(LONG), 300):
        code, _ = local.post(do="program", text=LONG[at : at + 300], more=at + 300 < len(LONG))
        assert code == 200
    assert local.post(do="pause")[0] == 200
    due = time.monotonic() + 40.0
    while (state := local.post(do="query", at="state")[1])["program"]["status"] == "planning":
        assert time.monotonic() < due
        time.sleep(0.05)
    assert local.post(do="steer", order="run")[0] == 200
    # Less than the owner may be silent.
    stays(arm, 0.3)
    state = local.post(do="query", at="state")[1]
    assert (state["program"]["status"], state["status"]) == ("paused", "paused")
    assert local.post(do="speed", value=0.5)[0] == 200
    code, refused = local.post("another-that-posts", do="resume")
    assert (code, refused["is"]) == (409, "refused")
    assert local.post(do="resume")[0] == 200
    wait(arm, lambda state: state.moving and state.speed == 0.5, 5.0)
    assert local.post(do="pause")[0] == 200
    wait(arm, lambda state: status(state) == "paused" and not state.moving, 5.0)
    code, _ = local.post("another-that-posts", do="stop")
    assert code == 200
    wait(arm, lambda state: state.stopped is not None and status(state) == "stopped", 5.0)


def test_page_paces_its_program_and_a_stranger_does_not(local: VirtualServer) -> None:
    async def driven() -> None:
        control, watching = await local.control(), await local.control()
        await control.say("program", text="steps:\n  - joints: [60, -64, 85, 8, 0]\n")
        await control.say("steer", order="run")
        await control.say("pause")
        await control.wait(40.0, headline="Paused by you", orders=["end"])
        await control.say("resume")
        await control.say("speed", value=0.2)
        await control.wait(mood="program", speed=0.2)
        assert not [each for each in control.heard if each["is"] == "refused"]
        await watching.say("pause")
        assert "holds the arm" in (await watching.notice("refused"))["why"]
        await control.wait(mood="program")
        for each in (control, watching):
            await each.close()

    local.run(driven())
