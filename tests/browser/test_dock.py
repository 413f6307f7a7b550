"""The dock of the sheets: its side, its width and what was open, which the browser remembers."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import FloatRect, Page, expect

from tests.browser.camera import Drawing
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE
from tests.browser.sight import wait_whole
from tests.browser.sizes import PHONE, PORTRAIT, WIDE
from tests.browser.test_accessibility import findings

SMALL = (1024, 768)
"""Size [px] of a window in which viser's panel and the dock leave little to the picture."""

NARROWEST = 300.0
"""[px] Minimum width of the dock."""

PANEL = 324.0
"""[px] Width of viser's panel, with its edge."""


def box(page: Page, selector: str) -> FloatRect:
    area = page.locator(selector).bounding_box()
    assert area is not None, f"{selector} is not shown"
    return area


def width(page: Page) -> float:
    return box(page, "#dock")["width"]


def edge(page: Page) -> tuple[float, float]:
    """Return a pixel of the inner edge of the dock, once it can be dragged."""
    page.locator("#dock-edge").wait_for()
    area = box(page, "#dock-edge")
    return area["x"] + 3.0, area["y"] + 0.7 * area["height"]


def drag(page: Page, by: float) -> None:
    """Drag the edge of the dock by ``by`` px to the right."""
    x, y = edge(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by, y, steps=4)
    page.mouse.up()


def choose_side(page: Page, side: str) -> None:
    page.click("#more-button")
    page.get_by_label("Side of the sheets").select_option(side)
    page.click("#more-button")


@pytest.fixture
def alone(server: AppServer, open_page: OpenPage) -> Page:
    """Return a new window with our page alone."""
    page = open_page(server.url, window=WIDE, drawing=Drawing.NONE).page
    # Names of viser's page, which belong to ours.
    page.route("**/static/viser/**", lambda route: route.continue_())
    return page


def test_side_width_and_open_sheets_survive_a_reload(alone: Page) -> None:
    alone.click("#jog-button")
    alone.click("#teach-button")
    alone.locator("#teach").wait_for()
    first = width(alone)
    drag(alone, 48.0)
    assert width(alone) == pytest.approx(first - 48.0, abs=1.0)
    choose_side(alone, "left")
    assert box(alone, "#dock")["x"] == 0.0
    assert box(alone, "#stage")["x"] == pytest.approx(width(alone), abs=1.0)
    # At the left, the edge widens the dock to the right.
    drag(alone, 20.0)
    before = box(alone, "#dock")
    alone.reload()
    for sheet in ("#jog", "#teach"):
        alone.locator(sheet).wait_for()
    assert box(alone, "#dock") == before
    assert before["width"] == pytest.approx(first - 28.0, abs=1.0)
    # What was closed stays closed.
    alone.click("#teach-button")
    alone.click("#jog-button")
    alone.reload()
    alone.locator("#teach-button").wait_for()
    assert not alone.locator("#dock").is_visible()
    choose_side(alone, "right")
    alone.click("#jog-button")
    assert box(alone, "#stage")["x"] == 0.0


@pytest.mark.long
def test_keys_change_the_width_within_its_limits(alone: Page) -> None:
    alone.click("#jog-button")
    edge(alone)
    separator = alone.get_by_role("separator", name="Width of the sheets")
    expect(separator).to_have_attribute("aria-orientation", "vertical")
    before = width(alone)
    separator.focus()
    alone.keyboard.press("ArrowLeft")
    assert width(alone) == before + 16.0
    alone.keyboard.press("ArrowRight")
    assert width(alone) == before
    # The picture keeps half of the page, beside viser's panel.
    for _ in range(10):
        alone.keyboard.press("ArrowLeft")
    assert width(alone) == WIDE[0] / 2 - PANEL
    expect(separator).to_have_attribute("aria-valuenow", "28")
    for _ in range(10):
        alone.keyboard.press("ArrowRight")
    assert width(alone) == NARROWEST
    expect(separator).to_have_attribute("aria-valuenow", "21")
    # Everything in the sheet is still inside.
    alone.locator("#gripper button").first.wait_for()
    assert alone.evaluate(
        "() => { const jog = document.getElementById('jog');"
        " return jog.scrollWidth <= jog.clientWidth; }"
    )
    choose_side(alone, "left")
    separator.focus()
    alone.keyboard.press("ArrowRight")
    assert width(alone) == NARROWEST + 16.0


@pytest.mark.cases(1)
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("size", [WIDE, SMALL])
def test_arm_is_whole_between_dock_and_panel(
    server: AppServer, open_page: OpenPage, size: tuple[int, int], side: str, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=size, own_camera=True)
    window = page.page
    choose_side(window, side)
    window.click("#jog-button")
    wait_whole(page, f"with the dock at the {side}")
    picture = canvas(page)
    first = width(window)
    # Beside viser's panel, the picture has half of the page, and in a small window the most.
    assert picture["width"] >= size[0] / 2 or first == NARROWEST
    outwards = 40.0 if side == "left" else -40.0
    x, y = edge(window)
    window.mouse.move(x, y)
    window.mouse.down()
    view = camera(page)
    window.mouse.move(x + outwards, y, steps=4)
    # The picture keeps its size and its view until the end.
    page.page.wait_for_timeout(200)
    assert width(window) > first
    assert (canvas(page)["width"], camera(page)) == (picture["width"], view)
    window.mouse.up()
    page.wait_until(lambda: canvas(page)["width"] < picture["width"], "the narrower picture")
    wait_whole(page, "with a wider dock")
    page.keep(artefacts / f"dock-{side}-{size[0]}.png")
    assert findings(window) == []
    assert page.errors == []


def test_panel_is_folded_where_the_dock_leaves_too_little(
    server: AppServer, open_page: OpenPage
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=SMALL, own_camera=True)
    page.page.click("#jog-button")
    page.wait_until(lambda: canvas(page)["width"] >= 560.0, "room for the scene")
    focused = "() => document.activeElement.id"
    page.wait_until(lambda: page.page.evaluate(focused) == "jog-button", "the focus where it was")
    page.page.click("#jog-button")
    page.wait_until(lambda: canvas(page)["width"] == SMALL[0] - PANEL, "the panel again")


def canvas(page: ViserPage) -> FloatRect:
    """Return the place of the picture in viser's document [px]."""
    area: FloatRect = page.frame.evaluate(
        """() => {
            const { x, y, width, height } = __viserMutable.canvas.getBoundingClientRect();
            return { x, y, width, height };
        }"""
    )
    return area


def camera(page: ViserPage) -> list[float]:
    place: list[float] = page.frame.evaluate("() => __viserMutable.camera.position.toArray()")
    return place


@pytest.mark.long
def test_phone_opens_no_sheet_and_keeps_it_below(server: AppServer, open_page: OpenPage) -> None:
    script = """
        localStorage.setItem("katana450.sheets.open", "jog");
        localStorage.setItem("katana450.sheets.side", "left");
        localStorage.setItem("katana450.sheets.width", "600px");
    """
    phone = {"window": PORTRAIT, "drawing": Drawing.NONE, "script": script, **PHONE}
    page = open_page(server.url, **phone).page
    page.locator("#teach-button").wait_for()
    assert not page.locator("#dock").is_visible()
    page.tap("#jog-button")
    assert width(page) == PORTRAIT[0]
    assert box(page, "#scene")["y"] < box(page, "#dock")["y"]
    page.wait_for_timeout(500)
    assert not page.locator("#dock-edge").is_visible()
    page.tap("#more-button")
    assert not page.get_by_label("Side of the sheets").is_visible()
