"""Test that every gesture in the scene passes the command gate, with raw viser sockets.

The server is a separate process. The ticket of the newest state counts the commands to the arm, so
an unchanged ticket proves that none got through.
"""

from __future__ import annotations

import asyncio
from typing import Any

from katana450.client import aconnect
from katana450.client.asynchronous import AsyncClient
from katana450.server.api import answers
from tests.browser.server import AppServer
from tests.gateway.client import UPRIGHT, Control, Peer, opened

HANDLE = "/target/move"
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
