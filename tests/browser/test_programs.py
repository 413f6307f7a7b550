"""Programs on the page of a person who previews, pauses, stops and continues them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from katana450.client import connect
from katana450.server.api import answers
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, clear_stop, resume, take
from tests.browser.sizes import PHONE, PORTRAIT
from tests.browser.teach_sheet import open_sheet, press, says
from tests.browser.test_blocks import show
from tests.gateway.test_programs import wait as wait_progress

pytestmark = pytest.mark.long

STEP_3 = "#teach .steps li:nth-child(3)"

PLANNED = 60.0
"""Timeout [s] of a plan, on a busy machine."""


def test_steps_of_a_program_are_controlled_in_the_list(
    server: AppServer, open_page: OpenPage, truth: Truth, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, own_camera=True, **PHONE)
    take(page)
    open_sheet(page)
    page.page.locator("#teach > select").select_option("Circle with gripper")
    press(page, "Preview")
    page.page.locator(STEP_3).wait_for(timeout=60_000)

    with connect(server.url, "Reader") as reader:
        # The scene shows the arm at a time of the preview.
        slider = page.page.get_by_role("slider", name="Look at the time of the preview")
        slider.fill("1")
        shown = partial(reader.query, answers.ProgramPlan)
        page.wait_until(lambda: shown().look == 1.0, "the time of the preview", seconds=PLANNED)
        assert shown().steps[-1].mark == ""
        page.wait_until(lambda: page.page.locator(".steps [aria-current]").count() == 1, "the step")
        assert "1.0 s of" in (slider.get_attribute("aria-valuetext") or "")
        pause = page.page.get_by_role("button", name="Pause before step 3", exact=True)
        pause.click()
        wait_progress(reader, lambda run: run.breakpoints == (3,))
        page.wait_until(lambda: pause.get_attribute("aria-pressed") == "true", "the breakpoint")
        # The list changes, and the button keeps the focus.
        page.wait_until(lambda: pause.evaluate("each => each.matches(':focus')"), "the focus")
        page.keep(artefacts / "run_control.png")
        page.page.get_by_role("button", name="Run from step 2", exact=True).click()
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


TO_AND_FRO = """\
steps:
  - repeat: {times: 50, steps: [{joints: [30, -40, 60, 30, 0]}, {joints: [-30, -40, 60, 30, 0]}]}
"""


def test_handle_that_is_dragged_takes_over_from_the_program(
    page: ViserPage, server: AppServer, truth: Truth
) -> None:
    open_sheet(page)
    show(page, TO_AND_FRO)
    press(page, "Run")
    with connect(server.url, "Reader") as reader:
        wait_progress(reader, lambda run: run.status == "running" and run.step > 1)
        with page.grip_arrow(MOVE, "z") as grip:
            grip.sweep(0.05, 12)
            wait_progress(reader, lambda run: run.status == "stopped")
            page.wait_until(lambda: page.page.inner_text("#holder") == "You drive", "the arm")
        truth.wait(moving=False)
        page.wait_until(lambda: "took over" in says(page), "the reason")
        # The drag has turned axes 2 to 4, which the program leaves as they are.
        assert np.abs(np.degrees(truth.status()["q"][1:4]) - (-40, 60, 30)).max() > 1.0
        page.press_in_bar("Rewind")
        page.wait_until(
            lambda: np.abs(np.degrees(truth.status()["q"][1:4]) - (-40, 60, 30)).max() < 0.1,
            "the posture in which the drag began",
        )
        truth.wait(moving=False)
        page.page.get_by_role("button", name="Continue ").click()
        wait_progress(reader, lambda run: run.status == "running")
        page.press_in_bar("End")
        wait_progress(reader, lambda run: run.status == "stopped")
    assert page.errors == []
