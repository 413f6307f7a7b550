"""Test the owner of a program: websocket, HTTP and the sockets of a page."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import count

import pytest

from katana450.client import Client, RefusedError
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from tests.gateway.virtual import VirtualServer

LINES = "".join(f"  - line: {{by: {{z: {z}}}}}\n" for z in (20, -20))
SWEEPS = "".join(f"  - joints: [{angle}, -64, 85, 8, 0]\n" for angle in (60, -60, 50, -50, 40, -40))
LONG = f"name: Long\ntool: tcp\nsteps:\n{SWEEPS}{LINES * 6}  - home\n"
"""A script that takes a second or more to plan, and begins with a long motion."""

NUMBERS = count()


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


def send(arm: Client, text: str = LONG) -> None:
    """Send a script to be planned."""
    for at in range(0, len(text), 150):
        arm.ask(Program(text=text[at : at + 150], more=at + 150 < len(text)))


def planning(arm: Client) -> None:
    """Send a new script to be planned and then run; it never uses a kept plan."""
    send(arm, f"{LONG}# {next(NUMBERS)}\n")
    arm.ask(Steer(order=ProgramOrder.RUN))
    assert status(arm.query(answers.State)) == "planning"


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


def test_moved_arm_needs_a_new_plan(arm: Client) -> None:
    # Planning it takes much longer than the next question.
    send(arm, LONG + "# moved\n")
    wait(arm, lambda state: status(state) == "ready")
    arm.joints([0.1, -1.1, 1.4, 0.3, 0.0])
    arm.ask(Steer(order=ProgramOrder.RUN))
    program = arm.query(answers.State).program
    assert program is not None
    assert (program.status, program.why) == ("planning", "Planned again: the arm has moved.")
    wait(arm, lambda state: state.moving)


def test_owner_paces_the_program_and_others_only_stop_it(local: VirtualServer, arm: Client) -> None:
    planning(arm)
    wait(arm, lambda state: state.moving)
    arm.ask(requests.Pause())
    wait(arm, lambda state: status(state) == "paused" and not state.moving, 5.0)
    arm.ask(requests.Speed(value=0.2))
    with local.connect("Other") as other:
        for request in (requests.Pause(), requests.Resume(), requests.Speed(value=1.0)):
            with pytest.raises(RefusedError, match="Long holds the arm"):
                other.ask(request)
        assert status(other.query(answers.State)) == "paused"
        arm.ask(requests.Resume())
        state = wait(arm, lambda state: status(state) == "running" and state.moving, 5.0)
        assert state.speed == 0.2
        other.ask(requests.Stop())
    wait(arm, lambda state: status(state) == "stopped" and not state.moving, 5.0)


def test_owner_of_a_simple_program_paces_it(local: VirtualServer, arm: Client) -> None:
    with local.speaking() as lines:
        text = "name: Line\nsteps:\n  - joints: [60, -64, 85, 8, 0]\n  - home\n"
        assert lines.answer(do="program", text=text)["is"] == "done"
        wait(arm, lambda state: status(state) == "ready")
        assert lines.answer(do="steer", order="run")["is"] == "done"
        assert lines.answer(do="pause")["is"] == "done"
        wait(arm, lambda state: status(state) == "paused")
        assert lines.answer(do="resume")["is"] == "done"


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
