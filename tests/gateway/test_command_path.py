"""Test that every gesture in the scene passes the command gate, with raw viser sockets.

The server is a separate process. The ticket of the newest state counts the commands to the arm, so
an unchanged ticket proves that none got through.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from katana450.client import aconnect
from katana450.client.asynchronous import AsyncClient
from katana450.server.api import answers
from tests.browser.server import AppServer
from tests.gateway.client import UPRIGHT, Control, Peer, opened

HANDLE = "/target/move"
FAR = [1.2, 0.0, 0.5]
"""[m] Out of reach."""

SETTLED = 0.3
"""Time [s] in which the server has handled all messages and shown their effects."""


async def start(peer: Peer, name: str = HANDLE) -> None:
    await peer.say(type="TransformControlsDragStartMessage", name=name, owner="")


async def move(peer: Peer, *position: float, name: str = HANDLE) -> None:
    await peer.say(
        type="TransformControlsUpdateMessage",
        name=name,
        owner="",
        wxyz=UPRIGHT,
        position=list(position),
    )


async def end(peer: Peer, name: str = HANDLE) -> None:
    await peer.say(type="TransformControlsDragEndMessage", name=name, owner="")


def placed(heard: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the messages that move the handle."""
    return [m for m in heard if m["type"] == "SetPositionMessage" and m["name"] == HANDLE]


async def noted(watcher: AsyncClient, reason: str, who: str, command: str) -> Any:
    """Return the event of these values; the list is read at intervals, so it may come late."""
    async with asyncio.timeout(10.0):
        while True:
            for line in (await watcher.query(answers.EventLog)).lines:
                if (line.finding.reason, line.who, line.command) == (reason, who, command):
                    return line
            await asyncio.sleep(0.05)


async def at_rest(watcher: AsyncClient, after: int = 0) -> answers.State:
    """Return the state once the arm rests and more than ``after`` commands were given."""
    async with asyncio.timeout(20.0):
        while True:
            state = await watcher.query(answers.State)
            if not state.moving and state.ticket > after:
                return state
            await asyncio.sleep(0.02)


async def unmoved(watcher: AsyncClient, before: answers.State) -> bool:
    """Return whether the arm gets no command while the server handles the messages."""
    await asyncio.sleep(SETTLED)
    now = await watcher.query(answers.State)
    return (now.ticket, now.goal) == (before.ticket, before.goal)


async def taken_by(control: Control) -> None:
    if not control.status.get("mine"):
        await control.say("take")
    await control.wait(mine=True)


@pytest.mark.long
def test_handle_moved_by_a_spectator_springs_back(
    server: AppServer,
) -> None:
    async def drag() -> None:
        async with (
            opened(server.url) as (driver, driving),
            opened(server.url) as (other, watching),
            aconnect(server.url, "Watcher") as watcher,
        ):
            await taken_by(driving)
            before = await at_rest(watcher)
            await driver.listen()
            # First the lease is free; then the driver holds it.
            for held in (False, True):
                if held:
                    await start(driver)
                    await asyncio.sleep(SETTLED)
                await other.listen()
                await start(other)
                await move(other, 0.3, 0.1, 0.3)
                await move(other, 0.35, 0.1, 0.3)
                await end(other)
                assert await unmoved(watcher, before)
                notice = await watching.notice("refused")
                assert f"{driving.status['name']} holds the arm" in notice["why"]
                (back,) = placed(await other.listen())
                assert back["position"] != [0.35, 0.1, 0.3]
                assert placed(await driver.listen()) == []
            x, y, z = back["position"]
            await move(driver, x - 0.02, y, z)
            await end(driver)
            assert (await at_rest(watcher, before.ticket)).goal != before.goal
            await driving.say("release_lease")

    asyncio.run(drag())


@pytest.mark.long
def test_take_over_ends_the_drag_of_the_former_driver(server: AppServer) -> None:
    async def drag() -> None:
        async with (
            opened(server.url) as (first, driving),
            opened(server.url) as (second, taking),
            aconnect(server.url, "Watcher") as watcher,
        ):
            await taken_by(driving)
            await start(first)
            await move(first, 0.45, 0.05, 0.4)
            await at_rest(watcher, (await watcher.query(answers.State)).ticket - 1)
            await taken_by(taking)
            before = await at_rest(watcher)
            for y in (0.1, 0.15, 0.2):
                await move(first, 0.45, y, 0.4)
            assert await unmoved(watcher, before)
            # Its messages do not count as a part of the new driver's drag either.
            await start(second)
            await asyncio.sleep(SETTLED)
            await move(first, 0.45, 0.25, 0.4)
            await end(first)
            assert await unmoved(watcher, before)
            assert placed(await first.listen())
            await move(second, 0.45, -0.05, 0.4)
            after = await at_rest(watcher, before.ticket)
            assert after.goal != before.goal
            assert after.holder == taking.status["name"]
            await end(second)
            await taking.say("release_lease")

    asyncio.run(drag())


def test_drag_from_before_a_stop_moves_nothing_after_clear_stop(server: AppServer) -> None:
    async def drag() -> None:
        async with (
            opened(server.url) as (peer, control),
            aconnect(server.url, "Watcher") as watcher,
        ):
            await taken_by(control)
            await start(peer)
            await move(peer, 0.45, 0.0, 0.4)
            await control.say("stop")
            await control.wait(stop="confirmed")
            await move(peer, 0.45, 0.05, 0.4)
            await control.clear_stop()
            before = await at_rest(watcher)
            await move(peer, 0.45, 0.1, 0.4)
            assert await unmoved(watcher, before)
            await peer.listen()
            await end(peer)
            assert await unmoved(watcher, before)
            assert placed(await peer.listen())
            # A new drag moves the arm.
            await start(peer)
            await move(peer, 0.45, 0.05, 0.4)
            await end(peer)
            assert (await at_rest(watcher, before.ticket)).goal != before.goal
            await control.say("release_lease")

    asyncio.run(drag())


@pytest.mark.long
def test_first_control_used_acquires_the_free_lease_and_is_logged(
    server: AppServer,
) -> None:
    async def drag() -> None:
        async with (
            opened(server.url) as (peer, control),
            aconnect(server.url, "Watcher") as watcher,
        ):
            await control.wait(holder=None)
            await start(peer)
            await move(peer, *FAR)
            await control.wait(mine=True)
            name = control.status["name"]
            await at_rest(watcher)
            line = await noted(watcher, "out of reach", name, "MoveTool")
            assert line.grounds == "took the free lease"
            assert f"{name} (scene, took the free lease), MoveTool: " in server.output
            await end(peer)
            await peer.set("1 base turn", value=12.5)
            await control.say("stop")
            await control.wait(stop="confirmed")
            line = await noted(watcher, "stopped", name, "Stop")
            assert line.grounds == "anybody may stop the arm"
            await control.clear_stop()
            await control.say("release_lease")

    asyncio.run(drag())
