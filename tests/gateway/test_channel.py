"""Test channels of flooding clients, which must not delay others."""

from __future__ import annotations

import asyncio
import time
from itertools import pairwise

from katana450.arm.control.lease import Role
from katana450.server.service.budget import Budgets
from katana450.server.service.heartbeats import Arrival
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.web.channel import CLOSE_FRAME_TIMEOUT, GoneError
from katana450.server.web.program_socket import ProgramChannel

ASKED = 200


class Torrent:
    """A connection on which all requests have already arrived."""

    def __init__(self) -> None:
        self.left = ASKED
        self.arrival = Arrival(None)

    async def receive(self) -> str:
        if not self.left:
            await asyncio.Event().wait()
        self.left -= 1
        return '{"do": "heartbeat"}'

    async def send(self, _text: str) -> None:
        return

    async def close(self, _code: int, _why: str, /) -> None:
        raise GoneError


class Deaf(Torrent):
    """A connection that accepts no data, not even a close frame."""

    async def send(self, _text: str) -> None:
        await asyncio.Event().wait()

    async def close(self, _code: int, _why: str, /) -> None:
        await asyncio.Event().wait()


def test_flooding_client_does_not_delay_others() -> None:
    async def ask() -> list[int]:
        hub, torrent = Hub(time.monotonic), Torrent()
        program = ProgramChannel(hub, torrent, Budgets(hub.clock).of("a"))
        window = hub.join(Identity("session", "Torrent", Role.OPERATOR), "a-page", program.notify)
        asking = asyncio.create_task(program.run(window))
        taken = [torrent.left]
        while torrent.left:
            await asyncio.sleep(0)
            taken.append(torrent.left)
        asking.cancel()
        return taken

    taken = asyncio.run(ask())
    assert taken[-1] == 0
    assert max(before - after for before, after in pairwise(taken)) == 1


def test_unresponsive_flooder_is_disconnected() -> None:
    async def ask() -> None:
        hub, deaf = Hub(time.monotonic), Deaf()
        deaf.left = 10**9
        program = ProgramChannel(hub, deaf, Budgets(hub.clock).of("a"))
        window = hub.join(Identity("session", "Deaf", Role.OPERATOR), "a-page", program.notify)
        async with asyncio.timeout(10.0 * CLOSE_FRAME_TIMEOUT):
            await program.run(window)

    asyncio.run(ask())
