"""The page at every size and in both themes: arm and gizmo are in the picture and uncovered."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.state.state import Status
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.viser_bridge.themes import DARK
from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, turn
from tests.browser.sight import contrast, wait_whole, whole
from tests.browser.sizes import LANDSCAPE, PHONE, PORTRAIT, WIDE, WIDER
from tests.conftest import LONG
from tests.gateway.slow_link import SlowLink

SIZES = (WIDE, WIDER, PORTRAIT, LANDSCAPE)

MOODS = {*(status.value for status in Status), "moving", "program", "planning", "lost"}
"""All moods of an arm whose state is known."""

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
    page.settled(lambda: eye(page), "the camera")


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
                desk.settled(lambda: eye(desk), "the camera")
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
    turned = desk.settled(lambda: eye(desk), "the camera")
    resize(desk, PORTRAIT)
    assert np.allclose(eye(desk), turned, atol=1e-3)
    assert not whole(desk)
    # After a view button, the view is fitted again, also at later sizes.
    turn(desk, "Front")
    wait_whole(desk, "from the front")
    resize(desk, WIDE)
    wait_whole(desk, "from the front and wide")
    # While a pointer may hold a handle the camera stays.
    fitted = eye(desk)
    desk.page.mouse.move(300, 500)
    desk.page.mouse.down()
    desk.page.set_viewport_size({"width": PORTRAIT[0], "height": PORTRAIT[1]})
    desk.page.wait_for_timeout(500)
    assert np.allclose(eye(desk), fitted, atol=1e-3)
    desk.page.mouse.up()
    wait_whole(desk, "after the release")
    turn(desk, "3D")
    wait_whole(desk, "again")


def test_every_mood_has_a_visible_lamp(own_window: ViserPage) -> None:
    def lamp(mood: str) -> tuple[str, str]:
        """Return the colours of the lamp and of its background."""
        colours: list[str] = own_window.page.evaluate(
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
        own_window.page.emulate_media(color_scheme=scheme)
        neutral, _ = lamp("nothing that is known")
        for mood in MOODS:
            colour, ground = lamp(mood)
            assert colour != neutral, mood
            assert contrast(colour, ground) >= LEAST_CONTRAST, (mood, scheme)
        assert lamp("blocked") == lamp("limited") == ("rgb(196, 117, 0)", ground)


@pytest.mark.long
def test_window_is_as_its_system_until_its_person_chooses(desk: ViserPage) -> None:
    def themes() -> tuple[str, str]:
        """Return the theme of the page and that of viser's page in it."""
        return (
            desk.page.evaluate("() => document.documentElement.dataset.theme"),
            desk.frame.evaluate("() => document.documentElement.dataset.mantineColorScheme"),
        )

    for scheme in ("dark", "light"):
        desk.page.emulate_media(color_scheme=scheme)
        desk.wait_until(lambda scheme=scheme: themes() == (scheme, scheme), scheme)  # type: ignore[misc]
    desk.page.click("#more-button")
    chosen = desk.page.get_by_label("Theme", exact=True)
    chosen.select_option("Dark")
    desk.wait_until(lambda: themes() == ("dark", "dark"), "the choice")
    chosen.select_option("Light")
    desk.wait_until(lambda: themes() == ("light", "light"), "the other choice")
    desk.page.emulate_media(color_scheme="dark")
    desk.page.wait_for_timeout(200)
    assert themes() == ("light", "light")
    desk.page.emulate_media(color_scheme="light")
    desk.page.click("#more-button")


@pytest.mark.long
def test_dark_theme_applies_from_the_first_frame_on_a_slow_phone(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    with SlowLink(server.port, 1e6, delay=0.15) as line:
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
        shades = [part.evaluate("() => [...shades]") for part in (page.page.main_frame, page.frame)]
        assert set(shades[0]) == {NIGHT}
        assert {NIGHT, "viser dark"} <= set(shades[1]) <= {NIGHT, "viser dark", "bare dark"}
        page.keep(artefacts / "phone.png")
        sky = np.median(page.scene_picture()[5:15].reshape(-1, 3), axis=0)
        assert sky.max() < max(DARK.floor) + 30
        assert page.errors == []
