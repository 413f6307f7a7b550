"""A page after the loss of its server, with a silent connection, or reloaded during a drag."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from playwright.sync_api import Worker

from katana450.client import connect
from katana450.server.api import answers
from tests.browser.camera import Drawing
from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import ViserPage
from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.browser.session import MOVE, Truth, bar, camera, clear_stop, take
from tests.browser.test_app import Robot
from tests.gateway.slow_link import DelayedLink, SlowLink


def worker_of(page: ViserPage) -> Worker:
    """Return the worker that holds the connection of the page."""
    (worker,) = (worker for worker in page.page.workers if worker.url.endswith("link.js"))
    return worker


def wait_answered(page: ViserPage) -> None:
    """Wait until the server has answered a heartbeat that was sent after this call."""
    worker = worker_of(page)
    last = worker.evaluate("count")
    answered = "(n) => count > n && ![...heartbeats.keys()].some((each) => each <= n + 1)"
    page.wait_until(lambda: worker.evaluate(answered, last), "an answer")


@pytest.mark.long
def test_page_reports_a_killed_server_and_reconnects(
    page: ViserPage, server: AppServer, artefacts: Path
) -> None:
    robot = Robot(page)
    started = camera(page)
    page.page.mouse.move(300, 500)
    page.page.mouse.down()
    page.page.mouse.move(420, 560, steps=5)
    page.page.mouse.up()
    page.page.mouse.wheel(0, 300)
    looked = page.settled(lambda: camera(page), "the camera")
    assert not np.allclose(looked, started, atol=0.02)
    server.kill()
    killed = time.monotonic()
    page.page.wait_for_selector("#banner.lost")
    noticed = time.monotonic() - killed
    page.keep(artefacts / "gateway-lost.png")
    assert "Offline" in bar(page, "link")
    assert bar(page, "headline") == "No connection"
    page.page.keyboard.press("Control+z")
    assert bar(page, "toast") == "No connection to the arm."
    assert noticed < 1.0
    robot.since = time.time()
    server.restart()
    page.page.wait_for_selector("#banner", state="hidden")
    page.wait_until(lambda: page.connected, "viser to come back")
    page.wait_until(lambda: bar(page, "headline") != "No connection", "the state")
    page.wait_ready(("/arm", MOVE))
    robot.settle()
    # viser starts with its first view; then the camera is restored, and stays.
    page.wait_until(lambda: np.allclose(camera(page), looked, atol=2e-3), "the old view")
    assert np.allclose(page.settled(lambda: camera(page), "the camera"), looked, atol=2e-3)
    page.drag_arrow(MOVE, "z", 0.03)
    robot.settle()
    # The console reports the lost connections.
    page.errors.clear()


class Attentive(NamedTuple):
    """A page over a slow line to a server that waits for heartbeats no longer than by default."""

    page: ViserPage
    truth: Truth
    line: SlowLink


@pytest.fixture(scope="module")
def attentive(windows: Windows) -> Iterator[Attentive]:
    with (
        AppServer(ATTENTIVE_APP) as server,
        SlowLink(server.port, 1e9) as line,
        windows.open(f"http://127.0.0.1:{line.port}", nodes=("/arm", MOVE)) as page,
    ):
        yield Attentive(page, Truth(server), line)
        assert page.errors == []


@pytest.mark.long
def test_first_drag_after_a_rest_does_not_stop_on_a_slow_connection(attentive: Attentive) -> None:
    page, truth, line = attentive
    worker = worker_of(page)
    # Heartbeats are seldom now.
    page.wait_until(lambda: worker.evaluate("free && performance.now() - used > USE"), "rest")
    # The page learns that it drives long after the heartbeat timeout.
    line.delay, line.late_answers = 0.6, True
    before = truth.status()["q"]
    page.drag_arrow(MOVE, "z", 0.03)
    page.wait_until(lambda: truth.status()["q"] != before, "motion")
    page.wait_until(lambda: not truth.status()["moving"], "rest")
    assert truth.status()["stopped"] is None
    line.delay, line.late_answers = 0.0, False
    wait_answered(page)


@pytest.mark.long
def test_silent_connection_is_reported_and_the_arm_stops(attentive: Attentive) -> None:
    page, truth, line = attentive
    page.type_number("1 base turn", -150.0)
    truth.wait(mood="moving")
    scene = page.page.locator("#scene")
    place = scene.bounding_box()
    line.cut = True
    truth.wait(1.0, mood="stopped")
    # A starved machine may say instead that it is too busy.
    assert "while the arm moved" in truth.status()["stopped"]
    page.page.wait_for_selector("#banner:not([hidden])", timeout=2500)
    # The banner describes a silent connection, and nothing shifts the scene.
    silence = "The arm does not answer. The picture is old."
    page.wait_until(lambda: bar(page, "banner") == silence, silence)
    assert scene.bounding_box() == place
    truth.wait(5.0, holder=None)
    line.cut = False
    page.page.wait_for_selector("#banner", state="hidden", timeout=10_000)
    clear_stop(page, truth)


@pytest.mark.long
def test_closed_window_frees_the_arm_and_a_reloaded_one_keeps_it(
    server: AppServer, truth: Truth, open_page: OpenPage
) -> None:
    first, other = (open_page(server.url, drawing=Drawing.NONE) for _ in range(2))
    take(first)
    name = truth.status()["holder"]
    first.page.reload(wait_until="commit")
    first.page.locator("#holder", has_text="You drive").wait_for()
    truth.wait(holder=name)
    first.page.close(run_before_unload=True)
    # The arm would be free after three seconds of silence even without a word of the page.
    truth.wait(2.0, holder=None)
    other.page.get_by_role("button", name="Take", exact=True).click()
    other.page.locator("#holder", has_text="You drive").wait_for()


def test_page_whose_line_has_become_slow_moves_nothing_after_letting_go(
    server: AppServer, open_page: OpenPage
) -> None:
    with DelayedLink(server.port) as line, connect(server.url) as watcher:
        page = open_page(f"http://127.0.0.1:{line.port}", nodes=("/arm", MOVE))
        take(page)

        def height() -> float:
            return float(np.array(watcher.query(answers.State).T)[2, 3])

        def rested() -> float:
            page.wait_until(lambda: not watcher.query(answers.State).moving, "the arm to rest")
            return height()

        start = rested()
        with page.grip_arrow(MOVE, "z") as grip:
            grip.to(0.02)
            page.wait_until(lambda: abs(height() - start) > 0.015, "the arm to follow")
            line.delay = 0.6
            grip.to(0.08)
            page.wait_until(lambda: "s late" in bar(page, "toast"), "the reason")
        wait_answered(page)
        assert abs(rested() - start) < 0.03
        page.page.evaluate("document.querySelector('#toast').textContent = ''")
        page.page.click("#jog-button")
        low = height()
        page.page.keyboard.down("KeyR")
        page.wait_until(lambda: "s late" in bar(page, "toast"), "the reason")
        page.page.keyboard.up("KeyR")
        assert abs(rested() - low) < 0.005
        line.delay = 0.0
        wait_answered(page)
        page.page.keyboard.down("KeyR")
        page.wait_until(lambda: height() - low > 0.01, "the arm to move")
        page.page.keyboard.up("KeyR")
