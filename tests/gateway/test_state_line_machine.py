"""Model-based test: after random actions the state line of a page never contradicts the API."""

from __future__ import annotations

import asyncio
import random
import time
from typing import Any

import pytest

from katana450.arm.control.messages import STATUS
from katana450.arm.control.state import Status
from tests.gateway.client import Control
from tests.gateway.virtual import VirtualServer

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
    news = program["status"] in ENDED and headline.startswith(
        (f"{program['name']}: ", "The script: ")
    )
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
        found = contradiction(shown, state)
        if not found:
            return str(shown["mood"])
        assert time.monotonic() < due, (
            found,
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
            for each in (one, other):
                moods.add(await agree(each, done))
                each.heard.clear()
            if one.status["stopped"] and not one.status["wait"] and chance.random() < 0.5:
                driver = one if one.status["may_clear_stop"] else other
                await driver.say("clear_stop")
        for each in (one, other):
            await each.close()
        return moods

    moods = local.run(played())
    wanted = {"ok", "moving", "stopped", "paused"}
    if actions > 500:
        wanted |= {"planning", "program", "limited"}
    assert wanted <= moods, moods
