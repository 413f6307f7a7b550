"""Forces of the fingers in a real browser: gauge, plot, and vibration of a gamepad and a phone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, expect

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
def test_gauge_and_plot_show_the_force_of_each_finger(page: Page, arm: Client) -> None:
    touch = arm.query(answers.State).touch
    assert touch is not None
    forces = [finger.force for finger in touch.fingers]
    page.click("#instruments-button")
    page.get_by_role("button", name="Arrange").click()
    page.get_by_role("button", name="Forces of the fingers [N]", exact=True).click()
    page.get_by_role("button", name="Arrange").click()
    check_shown(page, [("finger right", forces[0]), ("finger left", forces[1])], "holds rod")
    grip(arm, OPEN)
    check_shown(page, [("finger right", 0.0), ("finger left", 0.0)], "empty hand")


def check_shown(page: Page, forces: list[tuple[str, float]], held: str) -> None:
    """Check the forces [N] in the plot and the gauge. Only what is in the window is drawn."""
    gauge = page.get_by_role("meter", name="Grip force")
    gauge.scroll_into_view_if_needed()
    strongest = max(force for _, force in forces)
    expect(gauge).to_have_attribute("aria-valuetext", f"{strongest:.1f} N {held}")
    legend = page.locator("#instruments .card[data-id=grip-forces] .legend button")
    legend.first.scroll_into_view_if_needed()
    expect(legend).to_have_text([f"{name}{force:.2f}" for name, force in forces])


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
    page.wait_for_function("() => felt.some(({ strongMagnitude }) => strongMagnitude > 0.6)")
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
