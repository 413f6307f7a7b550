"""Our page under load: STOP among viewers and over a thin line, and pictures over a thin line."""

from __future__ import annotations

import asyncio
import threading
import time
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
"""[bytes/s] Rate of a thin line, on which viser alone shows pictures half a minute old."""


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


@pytest.mark.long
def test_slow_connection_shows_few_but_no_old_frames(
    page: ViserPage, server: AppServer, truth: Truth, open_page: OpenPage
) -> None:
    with SlowLink(server.port, 1e9) as line:
        far = open_page(f"http://127.0.0.1:{line.port}", nodes=("/arm", MOVE))
        node = next(
            name
            for name in far.frame.evaluate("() => Object.keys(__viserMutable.nodeRefFromName)")
            if name.endswith("/pan_link") and name.startswith("/arm")
        )
        line.rate = THIN

        def turns(each: ViserPage, since: float) -> list[tuple[float, float]]:
            sent = each.messages("SetOrientationMessage", node=node, since=since)
            return [(m.time, 2.0 * np.arctan2(m.body["wxyz"][3], m.body["wxyz"][0])) for m in sent]

        since = time.time()
        for degrees in (150.0, -150.0) * 2:
            page.type_number("1 base turn", degrees)
            page.page.wait_for_timeout(1000)
            truth.wait(20.0, mood="ok")
        rested = time.monotonic()
        far.wait_until(
            lambda: turns(far, since)[-1][1] == pytest.approx(turns(page, since)[-1][1], abs=1e-6),
            "the far window to show the end",
        )
        rested = time.monotonic() - rested
        near, seen = turns(page, since), turns(far, since)
        line.rate = 1e9
    # The age of a far frame is the time since the near window showed the same angle.
    ages = []
    times, angles = (np.array(each) for each in zip(*near, strict=True))
    for at, angle in seen:
        before = times <= at
        same = np.abs(angles[before] - angle) < 1e-6
        if same.any():
            ages.append(at - times[before][same][-1])
    print(
        f"{len(near)} pictures near, {len(seen)} far; age p50 {np.median(ages):.2f} s, "
        f"worst {max(ages):.2f} s"
    )
    assert np.median(ages) < 2.5
    assert max(ages) < 5.0
    assert rested < 5.0
