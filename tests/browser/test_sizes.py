"""The page at every size and in both themes: arm and gizmo are in the picture and uncovered."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.state import Status
from katana450.client import connect
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import requests
from katana450.server.viser_bridge.themes import DARK
from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import take, turn
from tests.browser.sight import contrast, overlap, wait_whole, whole
from tests.browser.sizes import LANDSCAPE, PHONE, PORTRAIT, WIDE, WIDER
from tests.conftest import LONG
from tests.gateway.slow_link import SlowLink

MOVE = "/target/move"
SIZES = (WIDE, WIDER, PORTRAIT, LANDSCAPE)

MOODS = {*(status.value for status in Status), "moving", "program", "planning", "lost"}
"""All moods of an arm whose state is known."""

LEAST_FINGER = 40.0
"""Minimum width and height of a button [px]."""

PRESSABLE = """() => Object.fromEntries(
    [...document.querySelectorAll("header button, #stage button")]
        .map((each) => [each.id || each.textContent, each.getBoundingClientRect()])
        .filter(([, { width }]) => width)
        .map(([name, { x, y, width, height }]) => [name, [x, y, width, height]]))"""
"""Script that returns position and size of all buttons of our page [px]."""

CUT = """() => {
    const list = document.querySelector("#acts select");
    const style = getComputedStyle(list);
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = style.font;
    const words = list.selectedOptions[0].text;
    const room = list.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight);
    const cut = (each) => each.scrollWidth > each.clientWidth;
    const driver = document.createRange();
    driver.selectNodeContents(document.getElementById("holder"));
    const { right } = document.querySelector("#who p").getBoundingClientRect();
    return {
        words,
        list: pen.measureText(words).width > room + 0.5,
        button: cut(document.querySelector("#acts button")),
        driver: driver.getBoundingClientRect().right > right + 0.5,
    };
}"""
"""Script that returns which words of the driver's row are cut."""

LEAST_CONTRAST = 3.0
"""Minimum contrast of a lamp to its background (WCAG 2.2, 1.4.11)."""

NOTED = """
    window.shades = new Set();
    (function note() {
        const { documentElement: html, body } = document;
        const root = document.getElementById("root");
        const seen = root?.childElementCount && getComputedStyle(root).opacity > 0;
        if (seen) shades.add(`viser ${html.dataset.mantineColorScheme}`);
        requestAnimationFrame(note);
        if (!body) return;
        const { backgroundColor, colorScheme } = getComputedStyle(window === top ? body : html);
        // Where nothing is painted the browser's own ground shows, which the scheme colours.
        const bare = backgroundColor === "rgba(0, 0, 0, 0)";
        shades.add(bare ? `bare ${colorScheme}` : backgroundColor);
    })();
"""
"""Script that records the background colour of each frame of a document."""

NIGHT = "rgb(20, 24, 29)"


@pytest.fixture(scope="module")
def desk(server: AppServer, windows: Windows) -> Iterator[ViserPage]:
    """Return a window with a mouse, which has the light theme first."""
    with windows.open(server.url, nodes=("/arm", MOVE), window=WIDE, own_camera=True) as page:
        yield page
        assert page.errors == []


def resize(page: ViserPage, size: tuple[int, int]) -> None:
    page.page.set_viewport_size({"width": size[0], "height": size[1]})
    page.page.wait_for_timeout(300)


def eye(page: ViserPage) -> FloatArray:
    """Return the camera position (3,) in three.js's world."""
    page.wait_drawn()
    return np.array(page.frame.evaluate("() => __viserMutable.camera.position.toArray()"))


@pytest.mark.long
def test_arm_and_gizmo_are_in_the_picture_at_every_size(desk: ViserPage, artefacts: Path) -> None:
    wait_whole(desk, "at first")
    first = eye(desk)
    for scheme in ("light", "dark") if LONG else ("light",):
        desk.page.emulate_media(color_scheme=scheme)
        for size in SIZES:
            resize(desk, size)
            wait_whole(desk, f"at {size}")
            desk.keep(artefacts / f"size-{size[0]}x{size[1]}-{scheme}.png")
            if size is WIDER:
                continue
            for button in ("instruments-button", "jog-button"):
                if button == "jog-button" and size is WIDE:
                    continue
                desk.page.click(f"#{button}")
                desk.page.wait_for_timeout(500)
                wait_whole(desk, f"at {size} with {button}")
                desk.keep(artefacts / f"size-{size[0]}x{size[1]}-{scheme}-{button[:-7]}.png")
                desk.page.click(f"#{button}")
    resize(desk, WIDE)
    desk.wait_until(lambda: np.allclose(eye(desk), first, atol=1e-3), "the first view again")


@pytest.mark.long
def test_a_view_chosen_by_the_person_is_kept(desk: ViserPage) -> None:
    resize(desk, WIDE)
    wait_whole(desk, "before")
    desk.page.mouse.move(300, 500)
    desk.page.mouse.down()
    desk.page.mouse.move(420, 530, steps=5)
    desk.page.mouse.up()
    desk.page.wait_for_timeout(500)
    turned = eye(desk)
    resize(desk, PORTRAIT)
    desk.page.wait_for_timeout(500)
    assert np.allclose(eye(desk), turned, atol=1e-3)
    assert not whole(desk)
    # After a view button, the view is fitted again, also at later sizes.
    turn(desk, "Front")
    wait_whole(desk, "from the front")
    resize(desk, WIDE)
    wait_whole(desk, "from the front and wide")
    turn(desk, "3D")
    wait_whole(desk, "again")


def test_every_mood_has_a_visible_lamp(desk: ViserPage) -> None:
    def lamp(mood: str) -> tuple[str, str]:
        """Return the colours of the lamp and of its background."""
        colours: list[str] = desk.page.evaluate(
            """(mood) => {
                const kept = document.body.dataset.mood;
                document.body.dataset.mood = mood;
                const lamp = getComputedStyle(document.getElementById("headline"), "::before");
                const { backgroundColor } = getComputedStyle(document.querySelector("header"));
                const found = [lamp.backgroundColor, backgroundColor];
                document.body.dataset.mood = kept;
                return found;
            }""",
            mood,
        )
        return colours[0], colours[1]

    for scheme in ("light", "dark"):
        desk.page.emulate_media(color_scheme=scheme)
        neutral, _ = lamp("nothing that is known")
        for mood in MOODS:
            colour, ground = lamp(mood)
            assert colour != neutral, mood
            assert contrast(colour, ground) >= LEAST_CONTRAST, (mood, scheme)
        assert lamp("blocked") == lamp("limited") == ("rgb(196, 117, 0)", ground)


@pytest.mark.long
def test_dark_theme_applies_from_the_first_frame_on_a_slow_phone(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    with SlowLink(server.port, 1e6, delay=0.15) as line:
        started = time.monotonic()
        page = open_page(
            f"http://127.0.0.1:{line.port}",
            nodes=("/arm", MOVE),
            window=PORTRAIT,
            own_camera=True,
            script=NOTED,
            color_scheme="dark",
            **PHONE,
        )
        wait_whole(page, "on a phone")
        print(f"there after {time.monotonic() - started:.1f} s")
        shades = [each.evaluate("() => [...shades]") for each in (page.page.main_frame, page.frame)]
        assert set(shades[0]) == {NIGHT}
        assert {NIGHT, "viser dark"} <= set(shades[1]) <= {NIGHT, "viser dark", "bare dark"}
        page.keep(artefacts / "phone.png")
        sky = np.median(page.scene_picture()[5:15].reshape(-1, 3), axis=0)
        assert sky.max() < max(DARK.floor) + 30
        # The panel is folded until a person opens it; the scene then gets the remaining height.
        assert not in_view(page, "1 base turn")
        page.frame.locator("#k450-sheet").tap()
        page.wait_until(lambda: in_view(page, "1 base turn"), "the panel")
        wait_whole(page, "above the panel")
        page.keep(artefacts / "phone-panel.png")
        page.page.tap("#jog-button")
        wait_whole(page, "above the pads")
        for key in page.page.locator("#jog kbd").all():
            assert not key.is_visible()
        page.keep(artefacts / "phone-jog.png")
        # A change of the system's theme changes both documents and the room.
        page.page.emulate_media(color_scheme="light")
        page.wait_until(
            lambda: (
                page.frame.evaluate("document.documentElement.dataset.mantineColorScheme")
                == "light"
            ),
            "the day",
        )
        sky = np.median(page.scene_picture()[5:15].reshape(-1, 3), axis=0)
        assert sky.min() > 200
        page.page.emulate_media(color_scheme="dark")
        assert page.errors == []


@pytest.mark.long
@pytest.mark.parametrize(("size", "scheme"), [(PORTRAIT, "light"), (LANDSCAPE, "dark")])
def test_buttons_of_the_lease_fit_on_a_phone(
    server: AppServer, open_page: OpenPage, size: tuple[int, int], scheme: str, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=size, color_scheme=scheme, **PHONE)
    with connect(server.url, "An arm driver with a long name") as other:
        take(page)
        page.wait_until(lambda: page.page.locator("#acts select").count(), "the other")
        assert overhang(page) <= 0.0
        found = page.page.evaluate(CUT)
        assert found == {"words": "Give to …", "list": False, "button": False, "driver": False}
        page.keep(artefacts / f"lease-{size[0]}-{scheme}.png")
        other.ask(requests.Ask())
        page.wait_until(lambda: page.page.get_by_text("Refuse").count(), "the request")
        assert overhang(page) <= 0.0
        other.ask(requests.Take())
        page.wait_until(lambda: page.page.get_by_text("Take over").count(), "who drives")
        assert overhang(page) <= 0.0


@pytest.mark.parametrize("size", [PORTRAIT, pytest.param(LANDSCAPE, marks=pytest.mark.long)])
def test_buttons_on_a_phone_are_finger_sized_and_covered_by_no_message(
    server: AppServer, open_page: OpenPage, size: tuple[int, int], artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=size, **PHONE)
    take(page)
    page.press_in_bar("STOP")
    page.page.wait_for_selector("#clear-stop:not([hidden])")
    for opener in ("jog-button", "objects-button"):
        page.page.tap(f"#{opener}")
        page.page.evaluate(
            "katana.toast('Axis 2: 300 is not between -124.3 and 7.8. It was not sent.')"
        )
        page.page.wait_for_selector("#toast.shown")
        found: dict[str, list[float]] = page.page.evaluate(PRESSABLE)
        assert {"stop", "clear-stop", opener} <= found.keys()
        assert min(min(box[2:]) for box in found.values()) >= LEAST_FINGER, found
        toast, reason = (page.page.locator(each).bounding_box() for each in ("#toast", "#why"))
        assert toast is not None
        assert reason is not None
        for name, (x, y, width, height) in found.items():
            assert not overlap(toast, x, y, width, height), name
            assert not overlap(reason, x, y, width, height), name
        assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        page.keep(artefacts / f"finger-{size[0]}-{opener}.png")
    # The help covers Clear stop.
    page.page.tap("#help-button")
    page.page.tap("#help button")
    assert not page.page.get_by_role("dialog").is_visible()
    page.press_in_bar("Clear stop")


def overhang(page: ViserPage) -> float:
    """Return the distance [px] of the bar's last button beyond the right edge of the screen."""
    right: float = page.page.evaluate(
        "() => Math.max(...[...document.querySelector('#acts').children]"
        ".map((each) => each.getBoundingClientRect().right))"
    )
    assert page.page.viewport_size is not None
    return right - page.page.viewport_size["width"]


def in_view(page: ViserPage, text: str) -> bool:
    """Return whether the text in viser's document is in the window."""
    found = page.frame.get_by_text(text, exact=True).first
    box = found.bounding_box() if found.is_visible() else None
    size = page.page.viewport_size
    assert size is not None
    return box is not None and box["y"] + box["height"] < size["height"]
