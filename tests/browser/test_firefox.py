"""Test the page in Firefox: it draws, a drag of the gizmo moves the arm, and STOP stops it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.client import Client, connect
from katana450.server.api import answers
from tests.browser.firefox import Firefox, needs_firefox
from tests.browser.server import SIMULATION_APP, AppServer
from tests.waiting import until

pytestmark = [needs_firefox, pytest.mark.long]

SCENE = Path(__file__).with_name("scene.js")
DRAWN = "document.querySelector('#poster').classList.contains('done')"
PULL = 60
"""[px] Length of a drag."""


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer(SIMULATION_APP) as server:
        yield server


@pytest.fixture(scope="module")
def arm(server: AppServer) -> Iterator[Client]:
    with connect(server.url, "Watcher") as client:
        yield client


@pytest.fixture(scope="module")
def firefox(server: AppServer) -> Iterator[Firefox]:
    with Firefox() as firefox:
        firefox.open(server.url)
        firefox.wait_until(DRAWN)
        yield firefox


def height(arm: Client) -> float:
    """Return the height of the tool [m]."""
    T = arm.query(answers.State).T
    assert T is not None
    return T[2][3]


def gripped(firefox: Firefox) -> tuple[float, float]:
    """Return the pixel of the window at which a press grips the arrow along z."""
    firefox.wait_until("__viserMutable.nodeRefFromName['/target/move']", in_frame=True)
    script = SCENE.read_text(encoding="utf-8").rstrip("\n;")
    firefox.evaluate(f"(window.harness = {{}}, {script}, true)", in_frame=True)
    places: list[list[float]] = []
    grip = "harness.grip('/target/move', 'arrow', 'z').then(({ pixel }) => pixel)"
    # The camera moves until arm and gizmo are in the picture.
    while len(places) < 5 or any(place != places[-1] for place in places[-5:]):
        places.append(firefox.evaluate(grip, in_frame=True))
        time.sleep(0.2)
    x, y = places[-1]
    left, top = firefox.evaluate(
        "(({ left, top }) => [left, top])(document.querySelector('#scene').getBoundingClientRect())"
    )
    return left + x, top + y


def test_drag_of_the_gizmo_moves_the_arm(firefox: Firefox, arm: Client, artefacts: Path) -> None:
    before = height(arm)
    # Drawing without a graphics card can keep Firefox from sending heartbeats, which pauses the arm
    # on its way. The next drag continues.
    for _ in range(3):
        x, y = gripped(firefox)
        firefox.drag([(x, y - step) for step in range(0, PULL + 1, 5)])
        until(lambda: not arm.query(answers.State).moving)
        if height(arm) > before + 0.02:
            break
    assert height(arm) > before + 0.02
    firefox.screenshot(artefacts / "firefox.png")


def test_stop_key_stops_the_arm_and_the_button_clears(firefox: Firefox, arm: Client) -> None:
    firefox.press(" ")
    until(lambda: arm.query(answers.State).stop == "confirmed")
    firefox.wait_until("document.querySelector('#headline').textContent === 'Stopped'")
    firefox.wait_until("!document.querySelector('#clear-stop').hidden")
    # It can be pressed 1 s after the stop.
    firefox.wait_until("!document.querySelector('#clear-stop').disabled")
    # The bar may still rearrange itself.
    time.sleep(0.2)
    firefox.click("#clear-stop")
    until(lambda: arm.query(answers.State).stopped is None)


def test_page_reports_no_error(firefox: Firefox) -> None:
    firefox.evaluate("true")
    # Firefox reports this rejection although `forgoCode` of static/viser.js handles it.
    handled = "EvalError: Running text as code is not allowed."
    assert [error for error in firefox.errors if error != handled] == []
