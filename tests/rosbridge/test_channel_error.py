"""An error in what a channel does by itself is logged, and ends the connection with the reason."""

from __future__ import annotations

import asyncio
import logging
import time

import pytest

from katana450.arm.control.lease import Role
from katana450.extensions.rosbridge.channel import RosChannel
from katana450.extensions.rosbridge.publications import Publications
from katana450.server.service.budget import Budgets
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.web.channel import GoneError


class SilentLine:
    """A connection whose client sends nothing until it is closed."""

    def __init__(self) -> None:
        self.arrival = LastHeartbeat()
        self.closed: list[tuple[int, str]] = []
        self._gone = asyncio.Event()

    async def receive(self) -> str:
        await self._gone.wait()
        raise GoneError

    async def send(self, _text: str) -> None:
        return

    async def close(self, code: int, why: str, /) -> None:
        self.closed.append((code, why))
        self._gone.set()


@pytest.mark.anyio
async def test_error_while_goals_continue_ends_the_connection(
    caplog: pytest.LogCaptureFixture,
) -> None:
    hub, line = Hub(time.monotonic), SilentLine()
    publications = Publications(hub, "")
    channel = RosChannel(hub, line, Budgets(hub.clock).of("a"), publications)
    client = hub.join(Identity("session", "A client", Role.OPERATOR), "a", channel.notify)

    def fail() -> bool:
        raise ZeroDivisionError

    channel._comes_to_rest = fail  # type: ignore[method-assign]
    channel._acting.set()
    with caplog.at_level(logging.ERROR):
        async with asyncio.timeout(20.0):
            await channel.run(client)
    ((code, why),) = line.closed
    assert code == 1011
    assert "internal error" in why
    assert "ZeroDivisionError" in caplog.text
