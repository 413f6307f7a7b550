"""Programs on a server: run, paused, stepped, continued and ended, and who may."""

from __future__ import annotations

import asyncio
import json
import secrets
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.state.state import State
from katana450.client import Client, RefusedError
from katana450.extensions.recording.playback.store import RecordingStore
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Breakpoints, Preview, Program, ProgramOrder, Steer
from tests.gateway.client import Control
from tests.gateway.postures import FAR, READY
from tests.gateway.virtual import VirtualServer

THERE_AND_BACK = """\
name: There and back
steps:
  - joints: [20, -64, 85, 8, 0]
  - line: {by: {z: 20}}
  - home
"""


@pytest.fixture
def arm(local: VirtualServer) -> Iterator[Client]:
    with local.connect("Test") as arm:
        yield arm


def planned(arm: Client, text: str) -> answers.Progress:
    """Send a script and wait until it is planned or refused."""
    for start in range(0, len(text), 100):
        more = start + 100 < len(text)
        arm.ask(Program(text=text[start : start + 100], more=more))
    return wait(arm, lambda program: program.status != "planning")


def wait(
    arm: Client, until: Callable[[answers.Progress], bool], seconds: float = 20.0
) -> answers.Progress:
    due, program = time.monotonic() + seconds, None
    while time.monotonic() < due:
        program = arm.query(answers.State).program
        if program is not None and until(program):
            return program
        time.sleep(0.02)
    raise AssertionError(f"still {program}")


def run(arm: Client, order: ProgramOrder = ProgramOrder.RUN) -> None:
    assert planned(arm, THERE_AND_BACK).status == "ready"
    arm.ask(Steer(order=order))


def test_program_runs_to_its_end_under_its_own_name(arm: Client) -> None:
    run(arm)
    during = arm.query(answers.State)
    assert during.holder is not None
    assert during.holder.startswith("There and back")
    lines = set()
    while (program := arm.query(answers.State).program) is not None and program.status == "running":
        lines.add(program.line)
        time.sleep(0.02)
    assert program is not None
    assert (program.status, program.why) == ("done", "")
    assert {3, 4, 5} <= lines
    after = arm.query(answers.State)
    assert after.holder is None
    assert np.abs(np.array(after.q) - READY).max() < 1e-9


def test_program_is_paused_stepped_and_ended(arm: Client) -> None:
    run(arm, ProgramOrder.STEP)
    assert wait(arm, lambda program: program.status == "paused").line == 4
    arm.ask(Steer(order=ProgramOrder.RESUME))
    wait(arm, lambda program: program.line == 5 and program.fraction > 0.1)
    arm.ask(Steer(order=ProgramOrder.PAUSE))
    assert wait(arm, lambda program: program.status == "paused").line == 5
    arm.ask(Steer(order=ProgramOrder.END))
    state = arm.query(answers.State)
    assert state.program is not None
    assert state.program.status == "stopped"
    assert state.holder is None


def test_script_that_is_too_long_is_refused(arm: Client) -> None:
    part = "#" * 900 + "\n"
    for _ in range(72):
        arm.ask(Program(text=part, more=True))
    with pytest.raises(RefusedError, match="at most 64 KB"):
        arm.ask(Program(text=part, more=True))


SCRIPT = """\
name: Three steps
steps:
  - joints: [12, -64, 85, 8, 0]
  - joints: [24, -64, 85, 8, 0]
  - joints: [12, -68, 85, 8, 0]
"""

END = np.deg2rad((12.0, -68.0, 85.0, 8.0, 0.0))


@pytest.fixture
def ready(local: VirtualServer) -> Iterator[Client]:
    with local.connect("Test") as ready:
        assert planned(ready, SCRIPT).status == "ready"
        yield ready


def posture(ready: Client) -> np.ndarray:
    return np.array(ready.query(answers.State).q)


def ended(ready: Client) -> answers.Progress:
    """Return the progress at the end of the run, which comes after its planning."""
    return wait(ready, lambda status: status.status in ("done", "failed", "refused", "stopped"))


def test_stopped_program_is_continued_after_the_stop_is_cleared(ready: Client) -> None:
    ready.ask(Steer(order=ProgramOrder.RUN))
    with pytest.raises(RefusedError, match="`resume` ends a pause"):
        ready.ask(Steer(order=ProgramOrder.CONTINUE))
    wait(ready, lambda status: status.step == 2 and status.fraction > 0.3)
    ready.stop()
    assert wait(ready, lambda status: status.status == "stopped").can_continue
    with pytest.raises(RefusedError, match="clear the stop"):
        ready.ask(Steer(order=ProgramOrder.CONTINUE))
    ready.clear_stop()
    stood = posture(ready)
    time.sleep(0.3)
    # Only the order moves it.
    assert np.array_equal(posture(ready), stood)
    ready.ask(Steer(order=ProgramOrder.CONTINUE))
    steps = set()
    while (now := ready.query(answers.State).program) is not None and now.status != "done":
        assert now.status in ("planning", "ready", "running"), now
        if now.status == "running":
            steps.add(now.step)
        time.sleep(0.02)
    assert steps == {2, 3}
    assert posture(ready) == pytest.approx(END, abs=1e-9)
    with pytest.raises(RefusedError, match="No program was interrupted"):
        ready.ask(Steer(order=ProgramOrder.CONTINUE))


@pytest.mark.parametrize("rests", [False, True], ids=["in its motion", "after its motion"])
def test_program_continues_from_a_moment_in_which_it_ran(
    local: VirtualServer, ready: Client, monkeypatch: pytest.MonkeyPatch, rests: bool
) -> None:
    ready.ask(Steer(order=ProgramOrder.RUN))
    wait(ready, lambda status: status.step == 2 and status.fraction > 0.3)
    moment = local.hub.present().state

    async def state_at(*_: object) -> State:
        return moment

    monkeypatch.setattr(RecordingStore, "state_at", state_at)
    assert wait(ready, lambda status: status.status == "done").can_continue is False
    ready.fork(1.0)
    assert moment.following is not None
    before = wait(ready, lambda status: status.can_continue)
    assert (before.status, before.step) == ("stopped", 2)
    if rests:
        local.sleep(3.0)
        assert not local.hub.present().state.moving
    ready.ask(Steer(order=ProgramOrder.CONTINUE))
    steps = []
    # The same plan is followed: nothing is planned, and the arm does not brake.
    while (now := ready.query(answers.State).program) is not None and now.status == "running":
        assert local.hub.present().state.following is not None
        steps.append(now.step)
        time.sleep(0.02)
    assert now is not None
    assert (now.status, set(steps) | {2}) == ("done", {2, 3})
    # One look at the arm is enough to find the end of the motion.
    assert (steps.count(2) < 4) == rests
    assert posture(ready) == pytest.approx(END, abs=1e-9)


def test_continuation_is_refused_after_the_gripper_has_moved(ready: Client) -> None:
    ready.ask(Steer(order=ProgramOrder.RUN))
    wait(ready, lambda status: status.step == 1 and status.fraction > 0.2)
    ready.ask(Steer(order=ProgramOrder.END))
    ready.go(requests.Gripper(angle=float(np.deg2rad(20.0))))
    with pytest.raises(RefusedError, match="the gripper has moved"):
        ready.ask(Steer(order=ProgramOrder.CONTINUE))


def test_program_begins_at_a_step_and_pauses_before_another(ready: Client) -> None:
    ready.ask(Breakpoints(steps=(3,)))
    ready.ask(Steer(order=ProgramOrder.RUN, at=2))
    paused = wait(ready, lambda status: status.status == "paused")
    assert (paused.step, paused.steps, paused.breakpoints) == (3, 3, (3,))
    assert paused.skipped == (1,)
    assert posture(ready)[0] == pytest.approx(np.deg2rad(24.0), abs=1e-9)
    # A program that rests may go to another step.
    ready.ask(Breakpoints(steps=()))
    ready.ask(Steer(order=ProgramOrder.RUN, at=3))
    done = ended(ready)
    assert (done.status, done.skipped) == ("done", (1, 2))
    assert posture(ready) == pytest.approx(END, abs=1e-9)


def test_plan_has_the_steps_and_the_time_that_is_looked_at(ready: Client) -> None:
    plan = ready.query(answers.ProgramPlan)
    assert plan.program is not None
    assert plan.text.startswith("name: Three steps")
    assert [step.mark for step in plan.steps] == ["", "", ""]
    assert plan.seconds == plan.program.seconds
    assert plan.seconds == pytest.approx(sum(step.seconds for step in plan.steps))
    first = plan.steps[0].seconds
    ready.ask(Preview(at=first + 0.01))
    plan = ready.query(answers.ProgramPlan)
    assert plan.look == first + 0.01
    assert [step.mark for step in plan.steps] == ["", "shown", ""]
    ready.ask(Preview(at=1e9))
    assert ready.query(answers.ProgramPlan).look == plan.seconds
    ready.ask(Preview(at=None))
    assert ready.query(answers.ProgramPlan).look is None
    ready.ask(Steer(order=ProgramOrder.RUN))
    wait(ready, lambda status: status.step == 2)
    with pytest.raises(RefusedError, match="the arm itself shows it"):
        ready.ask(Preview(at=1.0))
    plan = ready.query(answers.ProgramPlan)
    assert [step.mark for step in plan.steps] == ["done", "now", "next"]
    assert (plan.seconds, plan.look) == (0.0, 0.0)
    ended(ready)
    with pytest.raises(RefusedError, match="Plan the program from its beginning"):
        ready.ask(Preview(at=1.0))


def test_preview_of_nothing_is_refused(arm: Client) -> None:
    plan = arm.query(answers.ProgramPlan)
    assert (plan.text, plan.program, plan.steps) == ("", None, ())
    with pytest.raises(RefusedError, match="No program is planned"):
        arm.ask(Preview(at=1.0))


def test_step_that_does_not_exist_is_refused(ready: Client) -> None:
    ready.ask(Steer(order=ProgramOrder.RUN, at=4))
    refused = wait(ready, lambda status: status.status == "refused")
    assert "There is no step 4: Three steps has 3 steps." in refused.why
    with pytest.raises(RefusedError, match="begin at a step"):
        ready.ask(Steer(order=ProgramOrder.PAUSE, at=1))


def test_program_key_is_secret_and_required(
    local: VirtualServer, caplog: pytest.LogCaptureFixture
) -> None:
    key = secrets.token_hex(16)

    def do(**request: Any) -> tuple[int, Any]:
        names = {"X_Program": key, "X_Name": "Sorter"}
        status, _, body = local.ask("/api/v1/do", data=json.dumps(request).encode(), **names)
        return status, json.loads(body)

    assert do(do="acquire")[0] == 200
    pages = [json.loads(local.ask(f"/api/v1/{page}")[2]) for page in ("state", "arm")]
    assert pages[0]["holder"] == "Sorter"
    assert key not in json.dumps(pages)
    # The name of a program does not serve as its key.
    assert local.post("Sorter", do="home")[0] == 422
    assert local.post(secrets.token_hex(16), do="home")[0] == 409
    assert key not in caplog.text
    # Reads of other clients, under any name, do not count as its heartbeats.
    assert do(do="joints", q=FAR.tolist())[0] == 200
    while (state := local.state()).stopped is None:
        local.ask("/api/v1/state", X_Program="Sorter", X_Name="Sorter")
        local.ask("/api/v1/state", X_Program=secrets.token_hex(16))
    assert state.stopped == "Sorter fell silent while the arm moved."
    assert state.q[0] < FAR[0] - 0.2
    # Reads open no windows: only the two programs that posted have one.
    assert state.participants == 2


WAVE = """\
name: Wave
speed: 0.2
steps:
  - joints: [100, -60, 85, 8, 0]
  - joints: [-100, -60, 85, 8, 0]
"""


async def until_program(owner: Control, status: str) -> None:
    async with asyncio.timeout(30.0):
        while True:
            await owner.say("query")
            program = (await owner.notice("state")).get("program") or {}
            if program.get("status") == status:
                return
            await asyncio.sleep(0.05)


async def test_owner_of_a_running_program_decides_about_requests(local: VirtualServer) -> None:
    owner, other = await local.control(), await local.control()
    await owner.say("program", text=WAVE)
    await until_program(owner, "ready")
    await owner.say("steer", order="run")
    await owner.wait(holder="Wave")
    await owner.wait(orders=["end"], pace="", planning=False, asking=[], own_program=True)
    assert not other.status["own_program"]
    await other.say("ask")
    await other.wait(asked=True)
    (asking,) = (await owner.wait(asking=[await numbered(owner, other)]))["asking"]
    # No other participant may decide.
    await other.say("decline", to=asking["number"])
    assert "do not hold" in (await other.notice("refused"))["why"]
    await owner.say("decline", to=asking["number"])
    refused = await other.notice("refused")
    assert refused["why"] == f"{owner.status['name']} declined your request."
    await other.wait(asked=False)
    await owner.wait(asking=[], holder="Wave")
    await other.say("ask")
    await owner.wait(asking=[asking])
    await owner.say("give", to=asking["number"])
    await other.wait(mine=True)
    await until_program(owner, "stopped")
    await owner.wait(mine=False, orders=[], holder=other.status["name"])


async def numbered(owner: Control, other: Control) -> dict[str, Any]:
    """Return ``other`` as the only entry in the list of requests that ``owner`` gets."""
    async with asyncio.timeout(5.0):
        while not owner.status["asking"]:
            await asyncio.sleep(0.01)
    (asking,) = owner.status["asking"]
    assert asking["name"] == other.status["name"]
    return dict(asking)
