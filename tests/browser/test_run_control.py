"""Breakpoints, a run from a step, and Continue after a stop, by finger on a phone and by mouse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from katana450.client import connect
from tests.browser.conftest import OpenPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, clear_stop, take
from tests.browser.sizes import PHONE, PORTRAIT, WIDE
from tests.gateway.test_programs import wait

STEP_3 = ".steps li:nth-child(3) button"


@pytest.mark.parametrize(
    ("window", "options"),
    [
        pytest.param(PORTRAIT, PHONE, marks=pytest.mark.long),
        pytest.param(WIDE, {}, marks=pytest.mark.long),
    ],
    ids=["phone", "desk"],
)
def test_steps_of_a_program_are_controlled_in_the_list(
    server: AppServer,
    open_page: OpenPage,
    truth: Truth,
    artefacts: Path,
    window: tuple[int, int],
    options: dict[str, Any],
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=window, own_camera=True, **options)
    take(page)
    if options:
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
        wait(reader, lambda each: each.breakpoints == (3,))
        page.wait_until(lambda: pause.get_attribute("aria-pressed") == "true", "the breakpoint")
        # The list is drawn again, and the button keeps the focus.
        page.wait_until(lambda: pause.evaluate("each => each.matches(':focus')"), "the focus")
        page.keep(artefacts / f"run_control_{window[0]}.png")
        page.frame.locator(".steps li:nth-child(2) button[name=run]").click()
        wait(reader, lambda each: each.status == "running" and each.step == 2)
        page.press_in_bar("STOP")
        wait(reader, lambda each: each.status == "stopped")
        truth.wait(moving=False)
        clear_stop(page, truth)
        page.page.get_by_role("button", name="Continue ").click()
        wait(reader, lambda each: each.status == "paused" and each.step == 3)
        pause.click()
        wait(reader, lambda each: each.breakpoints == ())
        # A press just after the button changed may have meant Pause, and is ignored.
        page.page.wait_for_timeout(600)
        page.press_in_bar("Resume")
        wait(reader, lambda each: each.status == "done")
    assert page.errors == []
