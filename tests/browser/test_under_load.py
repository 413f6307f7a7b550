"""STOP at our page among viewers, and over a thin line."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, clear_stop, go_home
from tests.gateway.client import SUBPROTOCOL as VISER
from tests.gateway.client import enter, page_name, websocket
from tests.gateway.slow_link import SlowLink

STOPS = 50
"""Number of stops in each of four situations."""

THIN = 15_000.0
"""[bytes/s] Rate of a thin line."""


@contextmanager
def crowd(server: AppServer, size: int) -> Iterator[None]:
    """Connect ``size`` viewers, each of which receives the whole scene."""
    over = threading.Event()

    async def watch() -> None:
        path = f"/viser?page={page_name()}"
        async with websocket(server.url, path, enter(server.url), subprotocols=[VISER]) as socket:
            while not over.is_set():
                try:
                    await asyncio.wait_for(socket.recv(), 0.2)
                except TimeoutError:
                    continue

    async def watch_all() -> None:
        await asyncio.gather(*(watch() for _ in range(size)))

    thread = threading.Thread(target=lambda: asyncio.run(watch_all()))
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.mark.long
def test_stop_works_under_any_load(
    page: ViserPage, server: AppServer, truth: Truth, open_page: OpenPage
) -> None:
    """Stop by a click during a jog, by keys during a drag, and over a slow connection."""
    took: list[float] = []

    def stopped() -> None:
        took.append(truth.wait(2.0, mood="stopped"))

    def while_jogging(presser: ViserPage) -> None:
        page.page.click("#jog-button")
        for number in range(STOPS):
            key = "KeyA" if number % 2 else "KeyD"
            page.page.keyboard.down(key)
            page.page.wait_for_timeout(60)
            presser.page.click("#stop")
            stopped()
            page.page.keyboard.up(key)
            clear_stop(page, truth)
        page.page.click("#jog-button")

    with SlowLink(server.port, 1e9) as line, crowd(server, 8):
        far = open_page(f"http://127.0.0.1:{line.port}", nodes=("/arm", MOVE))
        while_jogging(page)
        go_home(page, truth)
        for number in range(STOPS):
            with page.grip_arrow(MOVE, "z") as grip:
                grip.to(0.02)
                page.page.keyboard.press("Space" if number % 2 else "Escape")
                stopped()
                grip.to(-0.02)
            clear_stop(page, truth)
        for number in range(STOPS):
            page.drag_slider("1 base turn", 20.0 if number % 2 else -20.0, steps=2)
            page.frame.locator("body").press("Escape" if number % 2 else " ")
            stopped()
            clear_stop(page, truth)
        line.rate = THIN
        while_jogging(far)
        line.rate = 1e9
    assert len(took) == 4 * STOPS
    print(
        f"STOP {len(took)} of {4 * STOPS}, p50 {1e3 * np.median(took):.0f} ms, "
        f"worst {1e3 * max(took):.0f} ms"
    )
