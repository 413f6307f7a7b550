"""The app's own page in a real browser: STOP under load, handover, reload and slow connections."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import AXES, MOVE, THIN, Truth, bar, clear_stop, go_home
from tests.conftest import LONG
from tests.gateway.client import SUBPROTOCOL as VISER
from tests.gateway.client import enter, page_name, websocket
from tests.gateway.slow_link import SlowLink

STOPS = 50 if LONG else 3
"""Number of stops in each of four situations; more with `make test-long`."""


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


def test_command_from_before_a_stop_moves_nothing_after_it(page: ViserPage, truth: Truth) -> None:
    q = [page.slider_value(label) for label in AXES]
    with page.grip_arrow(MOVE, "z") as grip:
        page.page.keyboard.press("Space")
        truth.wait(mood="stopped")
        reset_by_key(page, truth)
        # The drag continues and moves nothing.
        grip.sweep(0.05, 5)
        page.page.wait_for_timeout(300)
        assert [page.slider_value(label) for label in AXES] == q
    page.wait_until(
        lambda: page.node_pose(MOVE)[2, 3] == pytest.approx(0.282, abs=2e-3), "the handle to return"
    )
    page.drag_arrow(MOVE, "z", 0.03)
    page.wait_until(lambda: page.slider_value("2 shoulder") != q[1], "a fresh drag to move it")
    page.click_button("Home")


def reset_by_key(page: ViserPage, truth: Truth) -> None:
    """Clear the stop by a key, because the mouse is in use."""
    page.page.wait_for_selector("#clear-stop:not([hidden]):enabled")
    page.page.focus("#clear-stop")
    page.page.keyboard.press("Enter")
    truth.wait(stopped=None)


def test_arm_is_handed_over(
    page: ViserPage, server: AppServer, truth: Truth, open_page: OpenPage, artefacts: Path
) -> None:
    other = open_page(server.url, nodes=("/arm", MOVE))
    me, they = (bar(each, "name").partition(",")[0] for each in (page, other))
    other.wait_until(lambda: bar(other, "holder") == f"{me} drives", "who drives")
    # A control of a person who does not drive springs back, and the reason is shown.
    before = other.slider_value("1 base turn")
    other.drag_slider("1 base turn", 40.0)
    other.wait_until(lambda: bar(other, "toast") == f"{me} holds the arm: ask for it.", "why not")
    other.wait_until(
        lambda: other.slider_value("1 base turn") == before, "the slider to spring back"
    )
    other.press_in_bar("Request")
    page.wait_until(lambda: f"{they} asks for it" in bar(page, "name"), "the request")
    page.keep(artefacts / "gateway-request.png")
    page.press_in_bar(f"Give to {they}")
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    assert truth.status()["holder"] == they
    page.press_in_bar("Take over")
    page.wait_until(lambda: bar(page, "holder") == "You drive", "the arm")
    page.page.select_option("#acts select", label=they)
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    other.press_in_bar("Release")
    page.wait_until(lambda: bar(page, "holder") == "Nobody drives", "nobody to drive")
    # The first person who uses a control drives.
    other.drag_slider("1 base turn", 10.0)
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    assert other.errors == []


@pytest.mark.long
def test_reloaded_page_still_drives(new_page: ViserPage) -> None:
    name = bar(new_page, "name")
    new_page.page.reload()
    new_page.page.locator("#holder", has_text="You drive").wait_for()
    assert bar(new_page, "name") == name


@pytest.mark.long
def test_slow_connection_shows_few_but_no_old_frames(
    page: ViserPage, server: AppServer, truth: Truth, open_page: OpenPage
) -> None:
    with SlowLink(server.port, 1e9) as line:
        far = open_page(f"http://127.0.0.1:{line.port}", nodes=("/arm", MOVE))
        node = "/arm/base_link/arm_base_link/pan_link"
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
        for degrees in (150.0, -150.0) * (2 if LONG else 1):
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
