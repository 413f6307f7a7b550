"""The handle at the tool: the label, the steps and the typed number while it is dragged."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from tests.browser.conftest import OpenPage
from tests.browser.finger import fingers
from tests.browser.page import ViserPage
from tests.browser.person import still
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, clear_stop, take
from tests.browser.sizes import PHONE, PORTRAIT

PITCH = "/target/move/pitch"

FADED = 0.25
"""Opacity of the parts of a handle that is not under the pointer."""

PIXEL = 2.0
"""Distance [mm] of a dragged handle from its target: the picture has coarse pixels."""


def label(page: ViserPage) -> str:
    shown = page.page.locator("#handle-label")
    return shown.inner_text() if shown.is_visible() else ""


def number(text: str) -> float:
    """Return the first number of ``text``, whose minus is a true one."""
    match = re.search(r"[+−]?\d+\.\d", text)
    assert match, text
    return float(match[0].replace("−", "-"))


def opacities(page: ViserPage) -> list[float]:
    """Return the opacity of each shape of the handle, in order."""
    return page.frame.evaluate(  # type: ignore[no-any-return]
        """(name) => {
            const shapes = [];
            katanaScene.node(name).traverse((part) => part.isMesh && shapes.push(part));
            return shapes.filter(({ visible }) => visible).map(({ material }) => material.opacity);
        }""",
        MOVE,
    )


def test_label_says_what_a_drag_changes_until_its_end(
    page: ViserPage, truth: Truth, artefacts: Path
) -> None:
    start, whole = truth.status()["T"][2][3], opacities(page)
    assert set(whole) == {1.0}
    with page.grip_arrow(MOVE, "z") as grip:
        assert label(page) == ""
        # The line and the head of the arrow that is held are lit, the other parts fade.
        assert sorted(opacities(page)) == [FADED] * (len(whole) - 2) + [1.0] * 2
        grip.sweep(0.04, 6)
        page.wait_until(lambda: label(page).startswith("z +"), "the label")
        assert number(label(page)) == pytest.approx(40.0, abs=PIXEL)
        assert page.page.get_attribute("#handle-label", "aria-hidden") == "true"
        page.keep(artefacts / "handle-label.png")
        assert opacities(page).count(1.0) == 2
    page.wait_until(lambda: label(page) == "", "the label to go")
    page.page.mouse.move(5.0, 100.0)
    page.wait_until(lambda: opacities(page) == whole, "all parts to be lit")
    truth.wait(20.0, moving=False)
    assert truth.status()["T"][2][3] - start == pytest.approx(0.04, abs=1e-3 * PIXEL)
    with page.grip_ring(PITCH, "y") as grip:
        grip.sweep(-0.2, 6)
        page.wait_until(lambda: label(page).startswith("pitch −"), "the angle")
        assert number(label(page)) == pytest.approx(-11.5, abs=3.0)
        assert label(page).endswith("°")


@pytest.mark.long
def test_label_says_how_near_the_nearest_part_is(
    page: ViserPage, truth: Truth, artefacts: Path
) -> None:
    with page.grip_arrow(MOVE, "z") as grip:
        grip.sweep(-0.3, 6)
        page.wait_until(lambda: label(page).endswith(" mm to the table"), "the table", seconds=20.0)
        truth.wait(20.0, moving=False)
        distance = 1e3 * truth.status()["margins"]["clearance"]
        page.wait_until(
            lambda: f"\n{distance:.1f} mm to the table" in label(page), f"{distance:.1f} mm"
        )
        page.keep(artefacts / "handle-near.png")


@pytest.mark.long
def test_control_snaps_and_shift_slows_a_drag(page: ViserPage, truth: Truth) -> None:
    def height() -> float:
        truth.wait(20.0, moving=False)
        return float(truth.status()["T"][2][3])

    def pitch() -> float:
        truth.wait(20.0, moving=False)
        return float(truth.status()["pitch"])

    start, keyboard = height(), page.page.keyboard
    drawn = page.node_pose(MOVE)[2, 3]
    with page.grip_arrow(MOVE, "z") as grip:
        keyboard.down("Control")
        grip.sweep(0.037, 6)
        page.wait_until(lambda: label(page) == "z +40.0 mm", "the step")
    keyboard.up("Control")
    assert height() - start == pytest.approx(0.04, abs=1e-6)
    assert page.node_pose(MOVE)[2, 3] - drawn == pytest.approx(0.04, abs=1e-6)
    start = height()
    with page.grip_arrow(MOVE, "z") as grip:
        grip.sweep(0.02, 3)
        keyboard.down("Shift")
        grip.sweep(-0.03, 6)
        page.wait_until(lambda: label(page).startswith("z +1"), "the fine way")
        assert number(label(page)) == pytest.approx(10.0, abs=PIXEL)
        drawn = page.node_pose(MOVE)[2, 3]
    keyboard.up("Shift")
    assert height() - start == pytest.approx(0.01, abs=1e-3 * PIXEL)
    page.wait_drawn()
    assert page.node_pose(MOVE)[2, 3] == pytest.approx(drawn, abs=1e-4)
    start = pitch()
    with page.grip_ring(PITCH, "y") as grip:
        keyboard.down("Control")
        grip.sweep(-0.3, 6)
        page.wait_until(lambda: label(page) == "pitch −15.0°", "the step")
    keyboard.up("Control")
    assert pitch() - start == pytest.approx(math.radians(-15.0), abs=1e-5)
    start = pitch()
    with page.grip_ring(PITCH, "y") as grip:
        keyboard.down("Shift")
        grip.sweep(0.3, 12)
        page.wait_until(lambda: label(page).startswith("pitch +"), "the fine turn")
        assert number(label(page)) == pytest.approx(3.4, abs=0.8)
    keyboard.up("Shift")
    assert pitch() - start == pytest.approx(0.06, abs=0.014)


@pytest.mark.long
def test_typed_number_is_the_distance_of_the_drag(
    page: ViserPage, truth: Truth, artefacts: Path
) -> None:
    form, keyboard = page.page.locator("#handle-form"), page.page.keyboard
    start = truth.status()["T"][2][3]

    def reaches(distance: float) -> None:
        def is_there() -> bool:
            state = truth.status()
            return not state["moving"] and abs(state["T"][2][3] - start - distance) < 1e-6

        page.wait_until(is_there, f"{distance} m", seconds=20.0)

    drawn = page.node_pose(MOVE)[2, 3]
    with page.grip_arrow(MOVE, "z") as grip:
        grip.sweep(0.02, 4)
        page.wait_until(lambda: label(page).startswith("z +"), "the label")
        keyboard.type("35,5")
        assert form.inner_text().split() == ["z", "mm"]
        assert label(page) == ""
        page.keep(artefacts / "handle-number.png")
        keyboard.press("Enter")
        page.wait_until(lambda: label(page) == "z +35.5 mm", "the number in the label")
        reaches(0.0355)
    reaches(0.0355)
    # The number still belongs to the drag, which has ended, and counts from its start.
    keyboard.type("-")
    form.wait_for()
    keyboard.press("Enter")
    assert page.page.get_attribute("#handle-number", "aria-invalid") == "true"
    keyboard.type("12.5")
    keyboard.press("Enter")
    form.wait_for(state="hidden")
    reaches(-0.0125)
    assert page.node_pose(MOVE)[2, 3] - drawn == pytest.approx(-0.0125, abs=1e-6)
    # The next drag begins where the handle is drawn.
    with page.grip_arrow(MOVE, "z") as grip:
        grip.sweep(0.01, 4)
        page.wait_until(lambda: label(page).startswith("z +"), "the label")
        assert number(label(page)) == pytest.approx(10.0, abs=PIXEL)
    keyboard.type("9")
    form.wait_for()
    keyboard.press("Escape")
    form.wait_for(state="hidden")
    truth.wait(mood="stopped")
    clear_stop(page, truth)


@pytest.mark.long
def test_typed_angle_is_that_of_the_ring(page: ViserPage, truth: Truth) -> None:
    start = truth.status()["pitch"]
    with page.grip_ring(PITCH, "y") as grip:
        grip.sweep(-0.1, 4)
        page.wait_until(lambda: label(page).startswith("pitch −"), "the label")
    page.page.keyboard.type("-20")
    page.page.keyboard.press("Enter")
    page.wait_until(
        lambda: abs(truth.status()["pitch"] - start - math.radians(-20.0)) < 1e-5, "the angle"
    )


@pytest.mark.long
def test_label_is_above_the_finger(
    server: AppServer, open_page: OpenPage, truth: Truth, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, own_camera=True, **PHONE)
    page.page.wait_for_selector("#views", state="attached")
    take(page)
    truth.wait(20.0, moving=False)
    still(page, lambda: page.project(page.node_pose(MOVE)[:3, 3]))
    start, end = page.grip_arrow(MOVE, "z").pixels(0.04)
    with fingers(page.page) as hand:
        hand.put(start)
        hand.move(end)
        page.wait_until(lambda: label(page).startswith("z +"), "the label")
        box = page.page.locator("#handle-label").bounding_box()
        assert box is not None
        assert box["y"] + box["height"] < end[1] - 30.0
        page.keep(artefacts / "handle-phone.png")
        hand.lift()
    page.wait_until(lambda: label(page) == "", "the label to go")
    assert page.errors == []
