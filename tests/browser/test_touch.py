"""Touch in a real browser: the pressure maps, and the vibration of a gamepad and a phone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

from katana450.client import Client, connect
from katana450.maths.geometry import se3
from katana450.server.api import answers, requests
from tests.browser.camera import Drawing
from tests.browser.conftest import Windows
from tests.browser.server import AppServer
from tests.browser.sizes import WIDE

OPEN, CLOSED = 0.3, -0.44
ROD, ROD_AT = [0.015, 0.31], (0.4477, 0.0)
"""[m] Radius and height of a rod, and its place below the fingers in the ready posture."""

DEVICES = """
    window.felt = [];
    const playEffect = (kind, effect) => (felt.push({ kind, ...effect }), Promise.resolve());
    const pad = {
        connected: true, buttons: [], axes: [], vibrationActuator: { playEffect },
    };
    navigator.getGamepads = () => [null, pad];
    navigator.vibrate = (ms) => felt.push({ kind: "phone", duration: ms });
"""
"""A gamepad and a phone that note what they play."""

INK = """(map) => {
    const { width, height } = map.querySelector("canvas");
    const { data } = map.querySelector("canvas").getContext("2d").getImageData(0, 0, width, height);
    return data.filter((value, i) => i % 4 === 3 && value > 0).length;
}"""
"""Returns the number of coloured taxels of a map."""


@pytest.fixture(scope="module")
def arm(server: AppServer) -> Iterator[Client]:
    """Return a program that drives, with a rod that stands between the open fingers."""
    x, y = ROD_AT
    T = se3.from_rotation_translation(np.eye(3), np.array((x, y, 0.0)))
    with connect(server.url, "Tester") as arm:
        grip(arm, OPEN)
        shape = requests.Shape.CYLINDER
        rod = requests.Place(name="rod", T=T, shape=shape, size=ROD, can_be_held=True)
        assert isinstance(arm.ask(rod), answers.Done)
        grip(arm, CLOSED)
        assert arm.query(answers.State).held == "rod"
        yield arm


def grip(arm: Client, angle: float) -> None:
    arm.go(requests.Gripper(angle=angle))


@pytest.fixture
def page(server: AppServer, arm: Client, windows: Windows) -> Iterator[Page]:
    """Return our own page without viser in its frame, with the devices."""
    grip(arm, CLOSED)
    with windows.open(server.url, window=WIDE, drawing=Drawing.NONE, script=DEVICES) as page:
        yield page.page
        assert page.errors == []


@pytest.mark.long
def test_maps_show_force_and_centre_of_pressure(page: Page, arm: Client) -> None:
    page.click("#instruments-button")
    card = page.locator("#instruments .card[data-id=pads]")
    card.wait_for()
    for side in ("Left", "Right"):
        force = card.locator("section", has_text=side).locator("output")
        page.wait_for_function(
            "(each) => each.textContent === '10.0 N'", arg=force.element_handle()
        )
        pad = card.get_by_role("img", name=f"{side} pad")
        assert 8 <= pad.evaluate(INK) <= 64
        assert "10.0 N, centre of pressure" in (pad.get_attribute("aria-label") or "")
        assert pad.locator("i").is_visible()
    grip(arm, OPEN)
    page.wait_for_function(
        """() => [...document.querySelectorAll(".pressure output")]
          .every((each) => each.textContent === "0.0 N")"""
    )
    for pad in card.get_by_role("img").all():
        assert pad.evaluate(INK) == 0
        assert not pad.locator("i").is_visible()
    state = arm.query(answers.State)
    assert state.touch is not None
    assert state.touch["pads"][0]["pressure"] == []
    grip(arm, CLOSED)


def felt(page: Page) -> list[dict[str, Any]]:
    """Return what the devices have played since the last call."""
    pulses: list[dict[str, Any]] = page.evaluate("() => felt.splice(0)")
    return pulses


@pytest.mark.long
def test_devices_vibrate_only_after_they_were_turned_on(page: Page, arm: Client) -> None:
    grip(arm, OPEN)
    page.click("#more-button")
    button = page.get_by_role("button", name="Vibrate on touch")
    assert button.get_attribute("aria-pressed") == "false"
    assert felt(page) == []
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    page.wait_for_timeout(200)
    felt(page)
    grip(arm, CLOSED)
    page.wait_for_function("() => felt.some(({ strongMagnitude }) => strongMagnitude > 0.9)")
    played = felt(page)
    assert {pulse["kind"] for pulse in played} == {"dual-rumble", "phone"}
    assert max(pulse.get("strongMagnitude", 0.0) for pulse in played) <= 1.0
    assert all(pulse["duration"] > 0 for pulse in played)
    # A force that lasts is not felt. States that were under way may still tell of the approach.
    page.wait_for_timeout(200)
    assert not [pulse for pulse in felt(page) if pulse.get("strongMagnitude")]
    page.wait_for_timeout(200)
    assert felt(page) == []
    button.click()
    grip(arm, OPEN)
    grip(arm, CLOSED)
    assert felt(page) == []
