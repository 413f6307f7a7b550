"""The log about a page that cannot be connected with viser."""

from __future__ import annotations

import asyncio
from unittest.mock import AsyncMock, MagicMock

import pytest
from uvicorn.protocols.utils import ClientDisconnected
from websockets.asyncio.server import ServerConnection, serve

from katana450.server.viser_bridge.proxy import SUBPROTOCOL, Proxy


async def keep_open(connection: ServerConnection) -> None:
    await connection.wait_closed()


@pytest.mark.parametrize(
    ("error", "warnings"),
    [(ClientDisconnected(), 0), (ConnectionRefusedError("refused"), 1)],
    ids=["page left", "other error"],
)
def test_page_that_leaves_at_once_is_not_taken_for_a_fault_of_viser(
    error: OSError, warnings: int, caplog: pytest.LogCaptureFixture
) -> None:
    browser = MagicMock(scope={"subprotocols": [SUBPROTOCOL]}, query_params={}, close=AsyncMock())
    browser.accept = AsyncMock(side_effect=error)

    async def visit() -> None:
        async with serve(keep_open, "127.0.0.1", 0, subprotocols=[SUBPROTOCOL]) as viser:
            port = next(iter(viser.sockets)).getsockname()[1]
            proxy = Proxy(MagicMock(), MagicMock(), MagicMock(), port, "key")
            await proxy._serve(browser, MagicMock())

    asyncio.run(visit())
    assert caplog.text.count("viser does not answer") == warnings
