"""The bar of the page: its size and order, its names for assistive technology, and sign-in."""

from __future__ import annotations

import gzip
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page

from katana450.arm.control.lease import Role
from katana450.resources import STATIC
from katana450.server.web.access_links import AccessFile
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import Truth, clear_stop

SIZES = {"phone": (390, 844), "tablet": (820, 1180), "desk": (1440, 900)}


@pytest.fixture
def sized(window: ViserPage) -> Iterator[Page]:
    """Return a window whose size and colours may be changed."""
    before = window.page.viewport_size
    assert before is not None
    yield window.page
    window.page.set_viewport_size(before)
    window.page.emulate_media(color_scheme="light")


@pytest.mark.parametrize(
    ("size", "scheme"),
    [
        ("phone", "dark"),
        ("tablet", "light"),
        ("desk", "light"),
        pytest.param("phone", "light", marks=pytest.mark.long),
        pytest.param("tablet", "dark", marks=pytest.mark.long),
        pytest.param("desk", "dark", marks=pytest.mark.long),
    ],
)
def test_stop_is_always_visible_and_the_largest_button(
    page: ViserPage, sized: Page, truth: Truth, artefacts: Path, size: str, scheme: str
) -> None:
    width, height = SIZES[size]
    sized.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    sized.set_viewport_size({"width": width, "height": height})

    def areas() -> dict[str, float]:
        """Return the areas of all buttons of the bar; -1 for one outside the window."""
        found: dict[str, float] = page.page.evaluate(
            """() => {
              const inside = ({left, top, right, bottom}) =>
                left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
              return Object.fromEntries(
                [...document.querySelectorAll("header button, header select")]
                  .map((each) => [each, each.getBoundingClientRect()])
                  .filter(([, box]) => box.width)
                  .map(([each, box]) => [each.id || each.textContent,
                    inside(box) ? box.width * box.height : -1]));
            }"""
        )
        return found

    places = []
    for state in ("driving", "stopped"):
        if state == "stopped":
            page.page.click("#stop")
            truth.wait(mood="stopped")
            page.page.wait_for_selector("#clear-stop:not([hidden])")
        found = areas()
        assert min(found.values()) > 0.0, found
        assert found["stop"] == max(found.values())
        assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        page.page.wait_for_timeout(300)
        page.keep(artefacts / f"gateway-{size}-{scheme}-{state}.png")
        places.append(sized.locator("#scene").bounding_box())
    assert places[0] == places[1]
    clear_stop(page, truth)


def test_everything_can_be_reached_by_keys_and_is_named(page: ViserPage) -> None:
    page.page.focus("#stop")
    order = ["stop"]
    for _ in range(9):
        page.page.keyboard.press("Tab")
        order.append(page.page.evaluate("() => document.activeElement.id"))
    # The buttons of the lease, which have no id, lie in between.
    buttons = ["instruments-button", "objects-button", "jog-button", "help-button", "more-button"]
    assert [each for each in order if each] == ["stop", "pause", *buttons, "scene"]
    page.page.click("#help-button")
    assert page.page.get_by_role("dialog", name="Help and keys").is_visible()
    assert page.page.locator("#headline").is_visible()
    page.page.click("#stop", trial=True)
    page.page.keyboard.press("Enter")
    assert not page.page.get_by_role("dialog").is_visible()
    for region in ("#mode", "#holder", "#toast"):
        assert page.page.get_attribute(region, "role") == "status"
    assert page.page.get_attribute("#banner", "role") == "alert"


def test_the_page_is_small() -> None:
    def sent(files: Iterable[Path]) -> int:
        """Return the size of the files as they are sent, compressed."""
        return sum(len(gzip.compress(path.read_bytes())) for path in files if path.is_file())

    assert sent(STATIC.iterdir()) < 40_000
    # The files in folders are loaded on first use.
    assert sent(STATIC.rglob("*")) < 100_000
    assert sum(path.stat().st_size for path in (STATIC / "instruments").iterdir()) < 70_000


def test_access_link_signs_in_and_leaves_no_trace(
    browser: Any, tmp_path: Path, artefacts: Path
) -> None:
    file = AccessFile.create(tmp_path / "access.json")
    token = file.give("Anna", Role.VIEWER, time.time() + 600.0)
    with AppServer((*APP, "--access", str(file.path))) as server:
        context = browser.new_context()
        requested: list[str] = []
        page = context.new_page()
        page.on("request", lambda request: requested.append(request.url))
        page.goto(server.url)
        page.wait_for_selector("#gate:not([hidden])")
        page.screenshot(path=artefacts / "gateway-gate.png")
        page.goto("about:blank")
        page.goto(f"{server.url}/#{token}")
        page.locator("#name", has_text="Anna").wait_for()
        assert page.url == f"{server.url}/"
        assert not [url for url in requested if token in url.partition("#")[0]]
        assert page.evaluate("() => document.cookie") == ""
        assert page.locator("#acts button").count() == 0
        # The next visit does not need the access link.
        again = context.new_page()
        again.goto(server.url)
        again.locator("#name", has_text="Anna").wait_for()
        context.close()
