"""Forces of the fingers in a real browser: gauge and plot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from katana450.client import Client, connect
from katana450.maths.geometry import se3
from katana450.server.api import answers, requests
from tests.browser.page import ViserPage
from tests.browser.server import AppServer

OPEN, CLOSED = 0.3, -0.44
ROD, ROD_AT = [0.015, 0.31], (0.4477, 0.0)
"""[m] Radius and height of a rod, and its place below the fingers in the ready posture."""


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


@pytest.mark.long
def test_gauge_and_plot_show_the_force_of_each_finger(own_window: ViserPage, arm: Client) -> None:
    page = own_window.page
    touch = arm.query(answers.State).touch
    assert touch is not None
    forces = [finger.force for finger in touch.fingers]
    page.click("#instruments-button")
    page.get_by_role("button", name="Choose").click()
    page.get_by_role("button", name="Forces of the fingers [N]", exact=True).click()
    page.get_by_role("button", name="Choose").click()
    check_shown(page, [("finger right", forces[0]), ("finger left", forces[1])], "holds rod")
    grip(arm, OPEN)
    check_shown(page, [("finger right", 0.0), ("finger left", 0.0)], "empty hand")
    assert own_window.errors == []


def check_shown(page: Page, forces: list[tuple[str, float]], held: str) -> None:
    """Check the forces [N] in the plot and the gauge. Only what is in the window is drawn."""
    gauge = page.get_by_role("meter", name="Grip force")
    gauge.scroll_into_view_if_needed()
    strongest = max(force for _, force in forces)
    expect(gauge).to_have_attribute("aria-valuetext", f"{strongest:.1f} N {held}")
    legend = page.locator("#instruments .card[data-id=grip-forces] .legend button")
    legend.first.scroll_into_view_if_needed()
    expect(legend).to_have_text([f"{name}{force:.2f}" for name, force in forces])
