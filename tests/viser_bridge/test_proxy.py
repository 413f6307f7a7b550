"""The line between page and viser: frames for a page that is behind, and the log without viser."""

from __future__ import annotations

import asyncio
from unittest.mock import AsyncMock, MagicMock

import pytest
from uvicorn.protocols.utils import ClientDisconnected
from websockets.asyncio.server import ServerConnection, serve

from katana450.server.viser_bridge.proxy import MAX_IN_FLIGHT_BYTES, SUBPROTOCOL, Proxy, _Line


async def keep_open(connection: ServerConnection) -> None:
    await connection.wait_closed()


@pytest.mark.parametrize(
    ("error", "warnings"),
    [(ClientDisconnected(), 0), (ConnectionRefusedError("refused"), 1)],
    ids=["page left", "other error"],
)
async def test_page_that_leaves_at_once_is_not_taken_for_a_fault_of_viser(
    error: OSError, warnings: int, caplog: pytest.LogCaptureFixture
) -> None:
    browser = MagicMock(scope={"subprotocols": [SUBPROTOCOL]}, query_params={}, close=AsyncMock())
    browser.accept = AsyncMock(side_effect=error)
    async with serve(keep_open, "127.0.0.1", 0, subprotocols=[SUBPROTOCOL]) as viser:
        port = next(iter(viser.sockets)).getsockname()[1]
        proxy = Proxy(MagicMock(), MagicMock(), MagicMock(), port, "key")
        await proxy._serve(browser, MagicMock())
    assert caplog.text.count("viser does not answer") == warnings


async def test_no_frame_is_taken_from_viser_while_the_page_is_behind() -> None:
    """Viser replaces what waits meanwhile, so a thin line shows few frames instead of old ones."""
    hub, browser = MagicMock(clock=lambda: 0.0), MagicMock(send_bytes=AsyncMock())
    hub.pictures.watching, hub.lease.holder = 1, None
    line = _Line(hub, MagicMock(), browser, "")
    line.slot = MagicMock(take=AsyncMock(return_value=bytes(MAX_IN_FLIGHT_BYTES)))
    line._flow.sent(100, 0.0)
    line._flow.seen(1, 0.0)
    sending = asyncio.create_task(line._down())
    for count in (1, 2):
        await asyncio.sleep(0.05)
        assert line.slot.take.await_count == browser.send_bytes.await_count == count
        line._note(MagicMock(seen=count + 1, made=None))
    sending.cancel()
