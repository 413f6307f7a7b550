"""The card of a real arm: acts that ask twice, and what is measured. An emulated arm answers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import MOVE, READY, Truth, clear_stop
from tests.browser.sizes import PHONE, SIZES, WIDE, in_sizes_and_schemes
from tests.browser.test_accessibility import AXE, VIOLATIONS
from tests.gateway.client import enter
from tests.real_arm.emulated import emulator


@pytest.fixture
def server() -> Iterator[AppServer]:
    with (
        emulator("--calibrated") as port,
        AppServer((*APP, "--arm", f"tcp://127.0.0.1:{port}")) as running,
    ):
        yield running


def arm(truth: Truth) -> dict[str, Any]:
    found: dict[str, Any] = truth.status()["arm"]
    return found


def shows(page: ViserPage, mode: str) -> None:
    """Wait until the card shows ``mode``."""
    summary = page.page.locator("#arm summary")
    page.wait_until(lambda: summary.inner_text() == f"Arm {mode}", f"{mode} on the card")


def wait_for(page: ViserPage, truth: Truth, mode: str) -> None:
    page.wait_until(lambda: arm(truth)["mode"] == mode, f"the mode {mode}")
    page.wait_until(
        lambda: page.page.inner_text("#arm summary") == f"Arm {mode}", "the mode on the card"
    )


def press(page: ViserPage, act: str) -> None:
    page.page.click(f"#arm [data-act={act}]")


def confirm(page: ViserPage, act: str) -> None:
    """Press the button of ``act``, tick what it asks, and press the button of the question."""
    press(page, act)
    page.page.check("dialog.hazard input")
    page.page.click("dialog.hazard button.main")


def test_arm_is_led_from_no_connection_to_holding_and_back(
    open_page: OpenPage, server: AppServer, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=WIDE)
    truth = Truth(server)
    page.page.wait_for_selector("#arm[open]")
    assert page.page.inner_text("#arm summary") == "Arm disconnected"
    assert "No connection" in page.page.inner_text("#arm [role=status]")
    assert "no emergency stop" in page.page.inner_text("#arm .why")
    press(page, "connect")
    wait_for(page, truth, "uncalibrated")
    page.keep(artefacts / "arm-card-uncalibrated.png")
    press(page, "engage")
    asked = page.page.locator("dialog.hazard")
    assert "calibrated since it was switched on" in asked.inner_text()
    go = asked.locator("button.main")
    assert go.is_disabled(), "the hazard must be confirmed"
    page.keep(artefacts / "arm-card-asks.png")
    page.page.keyboard.press("Escape")
    assert not asked.is_visible(), "Esc also leaves the question"
    assert arm(truth)["mode"] == "uncalibrated"
    press(page, "engage")
    asked.locator("input").check()
    go.click()
    wait_for(page, truth, "holding")
    page.wait_until(lambda: not page.page.locator("#arm .why").is_visible(), "the folded card")
    clear_stop(page, truth)
    page.press_in_bar("STOP")
    truth.wait(mood="stopped")
    page.page.click("#arm summary")
    press(page, "release")
    assert "the arm falls" in asked.inner_text()
    asked.locator("input").check()
    go.click()
    page.wait_until(lambda: arm(truth)["mode"] != "holding", "motors off")
    note = page.page.locator("#arm [role=status]")
    page.wait_until(lambda: note.inner_text() != "", "a sentence about the motors")
    page.keep(artefacts / "arm-card-released.png")


@pytest.mark.long
def test_card_shows_a_motion_of_the_arm(
    open_page: OpenPage, server: AppServer, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=WIDE)
    truth = Truth(server)
    page.page.wait_for_selector("#arm[open]")
    press(page, "connect")
    wait_for(page, truth, "uncalibrated")
    confirm(page, "engage")
    wait_for(page, truth, "holding")
    clear_stop(page, truth)
    page.click_button("Home")
    shows(page, "moving")
    page.keep(artefacts / "arm-card-moving.png")
    truth.wait(30.0, moving=False)
    np.testing.assert_allclose(truth.status()["q"], READY, atol=0.005)


@in_sizes_and_schemes(SIZES, ("portrait", "dark"))
def test_card_fits_and_is_accessible(
    open_page: OpenPage, server: AppServer, size: str, scheme: str, artefacts: Path
) -> None:
    touch = {} if size.startswith("wide") else PHONE
    page = open_page(
        server.url,
        nodes=("/arm", MOVE),
        window=SIZES[size],
        own_camera=True,
        color_scheme=scheme,
        **touch,
    )
    enter(server.url)
    page.page.wait_for_selector("#arm[open]")
    press(page, "connect")
    page.wait_until(
        lambda: page.page.inner_text("#arm summary") == "Arm uncalibrated", "the connection"
    )
    page.page.wait_for_timeout(500)
    page.keep(artefacts / f"arm-card-{size}-{scheme}.png")
    assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
    press(page, "calibrate")
    page.keep(artefacts / f"arm-card-asks-{size}-{scheme}.png")
    if AXE.exists():
        page.page.evaluate(AXE.read_text(encoding="utf-8"))
        assert page.page.evaluate(VIOLATIONS) == []
