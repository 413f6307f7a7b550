"""Programs on the page of a person who previews, pauses, stops and continues them."""

from __future__ import annotations

from pathlib import Path

import pytest

from katana450.client import connect
from tests.browser.conftest import OpenPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, clear_stop, resume, take
from tests.browser.sizes import PHONE, PORTRAIT
from tests.gateway.test_programs import wait as wait_progress

pytestmark = pytest.mark.long

STEP_3 = ".steps li:nth-child(3) button"


def test_steps_of_a_program_are_controlled_in_the_list(
    server: AppServer, open_page: OpenPage, truth: Truth, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, own_camera=True, **PHONE)
    take(page)
    page.frame.locator("#k450-sheet").tap()
    page.frame.get_by_role("tab", name="Programs").click()
    page.frame.get_by_role("button", name="Preview").click()
    page.frame.locator(STEP_3).first.wait_for(timeout=60_000)
    # The tab has the width of the panel.
    panel = page.frame.locator(".steps").bounding_box()
    tabs = page.frame.locator("[role=tablist]").bounding_box()
    assert panel is not None
    assert tabs is not None
    assert panel["width"] >= 0.8 * tabs["width"]

    with connect(server.url, "Reader") as reader:
        pause = page.frame.locator(f"{STEP_3}[name=pause]")
        pause.click()
        wait_progress(reader, lambda run: run.breakpoints == (3,))
        page.wait_until(lambda: pause.get_attribute("aria-pressed") == "true", "the breakpoint")
        # The list is drawn again, and the button keeps the focus.
        page.wait_until(lambda: pause.evaluate("each => each.matches(':focus')"), "the focus")
        page.keep(artefacts / "run_control.png")
        page.frame.locator(".steps li:nth-child(2) button[name=run]").click()
        wait_progress(reader, lambda run: run.status == "running" and run.step == 2)
        page.press_in_bar("STOP")
        wait_progress(reader, lambda run: run.status == "stopped")
        truth.wait(moving=False)
        clear_stop(page, truth)
        page.page.get_by_role("button", name="Continue ").click()
        end = page.page.get_by_role("button", name="End", exact=True).element_handle()
        wait_progress(reader, lambda run: run.status == "paused" and run.step == 3)
        # A button that is replaced with every step would lose a press.
        page.wait_until(lambda: "step 3" in page.page.inner_text("#why"), "the step in the bar")
        assert end.evaluate("each => each.isConnected")
        pause.click()
        wait_progress(reader, lambda run: run.breakpoints == ())
        resume(page)
        wait_progress(reader, lambda run: run.status == "done")
    assert page.errors == []
