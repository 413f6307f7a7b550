"""Test the state line and the motion controls of the bar: what moves or waits."""

from __future__ import annotations

import asyncio
import random
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.messages import STATUS
from katana450.arm.control.state.state import Finding, Reason, Status
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.server.page_state import ENDS, duration
from katana450.maths.collision.engine import Contact
from katana450.server.api.program_requests import Preview, ProgramOrder
from tests.gateway.client import Control
from tests.gateway.test_hub import PAGES
from tests.gateway.test_program_runner import Staged
from tests.gateway.virtual import VirtualServer


@pytest.fixture
def table(session: Session) -> Staged:
    return Staged(session)


def test_server_pauses_after_a_person_has_paused(table: Staged) -> None:
    driver = table.join(PAGES[0])
    table.hub.move(driver, cmd.Pause())
    table.hub.gate.pause(Finding(Reason.DRIVER_SILENT, 0.3))
    assert table.arm.holds == 1


def test_pace_is_refused_with_a_reason_to_all_but_the_driver(table: Staged) -> None:
    driver, other = (table.join(page, Role.OPERATOR) for page in PAGES)
    assert table.bar(driver)["pace"] == table.bar(other)["pace"] == ""
    table.touch(driver.person.key)
    assert table.bar(driver)["pace"] == ""
    assert table.bar(other)["pace"] == "Window 1 drives: ask for the arm."
    viewer = table.join("third", Role.VIEWER)
    assert table.bar(viewer)["pace"] == "You may watch, not drive."


@pytest.mark.parametrize(
    ("distance", "shown"),
    [
        (
            0.00512,
            {
                "distance": 5.1,
                "parts": ["left finger", "table"],
                "points": [[0.3, 0.0, 0.0051], [0.3, 0.0, 0.0]],
            },
        ),
        (0.031, None),
    ],
)
def test_two_nearest_parts_are_shown_below_30_mm(
    table: Staged, distance: float, shown: dict[str, Any] | None
) -> None:
    points = np.array([[0.3, 0.0, distance], [0.3, 0.0, 0.0]])
    normal = np.array([0.0, 0.0, -1.0])
    table.arm.nearest = Contact(("finger_left_link", "table"), distance, points, normal)
    assert table.bar(table.driver())["clearance"] == shown


def test_bar_says_plainly_that_no_path_was_found(table: Staged) -> None:
    participant = table.driver()
    table.arm.planning_failure = "The forearm meets the table."
    line = table.bar(participant)
    assert (line["mood"], line["headline"]) == ("limited", "No path found")
    assert line["why"].startswith("The forearm meets the table.")


def test_stop_is_in_progress_until_the_arm_rests(table: Staged) -> None:
    participant = table.driver()
    rest = table.arm.rest
    table.arm.rest = replace(rest, motion=replace(rest.motion, qd=rest.motion.qd + 0.1))
    table.stop("Anybody")
    table.wait(0.2, participant)
    shown = table.bar(participant)
    assert (shown["stop"], shown["headline"]) == ("confirmed", "Stopping…")
    table.arm.rest = rest
    assert table.bar(participant)["headline"] == "Stopped"


def test_running_program_shows_its_task_step_and_remaining_time(table: Staged) -> None:
    owner, other = (table.join(page) for page in PAGES)
    table.run(owner, "name: Nap\nsteps:\n  - wait: 30\n  - wait: 5\n")
    table.wait(10.5, owner)
    shown = table.bar(other)
    assert shown["mood"] == "program"
    assert shown["headline"] == "Nap: wait, step 1 of 2, 25 s left"
    progress = table.progress
    assert progress.seconds_left == pytest.approx(24.5, abs=0.2)
    table.programs.steer(owner, ProgramOrder.PAUSE)
    table.arm.rest = replace(table.arm.rest, paused=True)
    shown = table.bar(other)
    assert (shown["mood"], shown["headline"]) == ("paused", "Paused")
    assert shown["why"].startswith("Nap: wait, step 1 of 2, 25 s left.")


def test_end_of_a_program_is_told_until_the_next_command(table: Staged) -> None:
    owner, other = (table.join(page) for page in PAGES)
    table.run(owner, "name: Nap\nsteps:\n  - wait: 30\n  - wait: 1\n")
    table.wait(10.5, owner)
    table.programs.steer(owner, ProgramOrder.END)
    table.wait(0.1, owner)
    shown = table.bar(other)
    assert (shown["headline"], shown["end"]) == ("Ended: Nap", "")
    assert shown["why"] == "Window 1 ended it at step 1 of 2. Continue resumes it there."
    shown = table.bar(owner)
    assert shown["why"] == "You ended it at step 1 of 2. Continue resumes it there."
    assert (shown["orders"], shown["continues"]) == (["continue"], ["Nap", 1, 2])
    table.programs.steer(owner, ProgramOrder.CONTINUE)
    table.wait(32.0, owner)
    assert table.bar(owner)["headline"] == "Nap: done in 42 s"
    table.plan(owner, "steps:\n  - joints: [20, -60, 80, 8, 999]\n")
    shown = table.bar(owner)
    assert (shown["mood"], shown["headline"]) == ("limited", "Not possible: the script")
    assert "999" in shown["why"]
    # It may be mended, or another text is edited.
    wrong = table.arm.rest
    table.arm.rest = replace(wrong, grip=0.1)
    assert table.bar(owner)["headline"] == "On target"
    table.arm.rest = wrong
    assert table.bar(owner)["headline"] == "Not possible: the script"
    table.programs.handle(owner, Preview(at=None))
    assert table.bar(owner)["headline"] == "On target"
    table.plan(owner, "steps:\n  - joints: [20, -60, 80, 8, 999]\n")
    # As the planning worker reports a motion.
    table.programs.redirected()
    assert table.bar(owner)["headline"] == "On target"


def test_remaining_time_counts_the_present_speed(table: Staged) -> None:
    participant = table.join(PAGES[0])
    table.plan(participant, "steps:\n  - wait: 1\n  - joints: [20, -60, 80, 8, 0]\n")
    program = table.programs.program
    assert program is not None
    table.programs.steer(participant, ProgramOrder.RUN)
    table.wait(0.5, participant)
    table.arm.rest = replace(table.arm.rest, speed=0.5)
    table.wait(0.1, participant)
    progress = table.progress
    (plan,) = (task.action.plan for task in program.tasks if isinstance(task.action, FollowPlan))
    assert plan.duration_at(0.5) > 1.2 * plan.duration
    assert progress.seconds_left == pytest.approx(0.4 + plan.duration_at(0.5), abs=0.1)


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.2, "1 s"), (12.0, "12 s"), (99.0, "99 s"), (100.5, "1 min 41 s")]
)
def test_times_are_rounded_up(seconds: float, words: str) -> None:
    assert duration(seconds) == words


AGREE = 5.0
"""Timeout [s] until page and API agree; the status is sent ten times a second."""

SCRIPT = "name: Wag\nsteps:\n  - wait: 0.5\n  - joints: [{0}, -64, 85, 8, 0]\n  - wait: 0.5\n"

ENDED = ("done", "stopped", "failed", "refused", "cancelled")
"""Statuses of a program whose end is shown until the next command."""

SIMPLE = (
    "pause",
    "resume",
    "hold",
    "home",
    "stop",
    "clear_stop",
    "acquire",
    "release_lease",
    "take",
)


async def act(control: Control, chance: random.Random) -> str:
    """Do one random action and return it in words."""
    kind = chance.choice((*SIMPLE, "drag", "jog", "nudge", "gripper", "speed", "program", "steer"))
    match kind:
        case "drag":
            x, y, z = (chance.uniform(*ends) for ends in ((0.2, 0.7), (-0.4, 0.4), (-0.2, 0.5)))
            for part in (0.5, 1.0):
                await control.say("position", p=[x * part, y * part, z])
            await control.say("end_drag")
        case "jog":
            for _ in range(4):
                rates = [chance.uniform(-0.2, 0.2) for _ in range(3)]
                await control.say("jog", rates=[*rates, 0.0, 0.0])
                await asyncio.sleep(0.04)
            await control.say("jog", rates=[0.0] * 5)
        case "nudge":
            await control.say("nudge", axis=chance.randint(1, 5), by=chance.uniform(-1.0, 1.0))
        case "gripper":
            await control.say("gripper", angle=chance.uniform(0.0, 0.8))
        case "speed":
            await control.say("speed", value=chance.choice((0.2, 0.5, 1.0)))
        case "program":
            await control.say("program", text=SCRIPT.format(chance.randint(-60, 60)))
            if chance.random() < 0.8:
                await control.say("steer", order="run")
        case "steer":
            kind = chance.choice(("run", "step", "pause", "resume", "end"))
            await control.say("steer", order=kind)
        case _:
            await control.say(kind)
    return kind


def contradiction(shown: dict[str, Any], state: dict[str, Any]) -> str:
    """Return what the status ``shown`` by a page says other than ``state`` of the API; else ""."""
    mood, headline, status = shown["mood"], shown["headline"], state["status"]
    program = state.get("program") or {"status": "", "name": ""}
    heads = (f"{program['name']}: done", *(f"{word}: " for word in ENDS.values()))
    news = program["status"] in ENDED and headline.startswith(heads)
    if state.get("stopped") is not None:
        words = "Stopping…" if state["moving"] or state.get("stop") == "requested" else "Stopped"
        wanted, right = "stopped", headline == words
    elif status == Status.BLOCKED.value:
        wanted, right = status, headline == STATUS[Status.BLOCKED]
    elif program["status"] == "planning" and not state["moving"]:
        wanted, right = "planning", headline.startswith("Planning")
    elif status == Status.PAUSED.value:
        words = "Pausing…" if state["moving"] else "Paused"
        wanted, right = "paused", headline.startswith(words) or news
    elif program["status"] == "running":
        wanted, right = "program", headline.startswith((f"{program['name']}: ", "The script: "))
    elif state["moving"]:
        wanted = mood if mood in ("planning", "limited", "gap") else "moving"
        right = headline.startswith(("Moving", "Planning a path"))
    else:
        wanted, right = status, headline == STATUS[Status(status)] or news
    if news and program["status"] in ("failed", "refused"):
        wanted = "limited"
    if mood != wanted or not right:
        return f"{mood}: {headline}, but {wanted}"
    if shown["holder"] != state.get("holder") or shown["mine"] != (
        shown["name"] == state.get("holder")
    ):
        return f"{shown['holder']} drives, but {state['holder']}"
    if shown["speed"] != state["speed"]:
        return f"speed {shown['speed']}, but {state['speed']}"
    runs = program["status"] in ("running", "paused", "blocked")
    mine = shown["holder"] in (None, shown["name"])
    owned = runs and program["by"] == shown["name"]
    if (shown["pace"] == "") != (mine or owned):
        return f"pace refused with {shown['pace']!r}, held by {state['holder']}"
    if ("end" in shown["orders"]) != (
        program["status"] in ("planning", "running", "paused", "blocked")
        and program["by"] == shown["name"]
    ):
        return f"orders {shown['orders']}, but {program}"
    return ""


async def agree(control: Control, done: list[str]) -> str:
    """Wait until the status of the page agrees with the API, and return its mood."""
    due = time.monotonic() + AGREE
    while True:
        await control.say("query")
        state = await control.notice("state")
        shown = dict(control.status)
        difference = contradiction(shown, state)
        if not difference:
            return str(shown["mood"])
        assert time.monotonic() < due, (
            difference,
            done[-12:],
            shown,
            state.get("program"),
            state["why"],
        )
        await asyncio.sleep(0.02)


@pytest.mark.parametrize("actions", [150, pytest.param(1000, marks=pytest.mark.long)])
def test_state_line_never_contradicts_the_state(local: VirtualServer, actions: int) -> None:
    chance = random.Random(actions)

    async def played() -> set[str]:
        moods: set[str] = set()
        done: list[str] = []
        one, other = await local.control(), await local.control()
        await one.wait(mood="ok")
        await one.say("acquire")
        for _ in range(actions):
            control = one if chance.random() < 0.8 else other
            who = "one" if control is one else "other"
            done.append(f"{who} {await act(control, chance)}")
            await asyncio.sleep(chance.choice((0.0, 0.05, 0.3)))
            for window in (one, other):
                moods.add(await agree(window, done))
                window.heard.clear()
            if one.status["stopped"] and not one.status["wait"] and chance.random() < 0.5:
                driver = one if one.status["may_clear_stop"] else other
                await driver.say("clear_stop")
        return moods

    moods = local.run(played())
    wanted = {"ok", "moving", "stopped", "paused"}
    if actions > 500:
        wanted |= {"planning", "program", "limited"}
    assert wanted <= moods, moods
