"""The page in each language on a phone: no sentence in English, and no words without room."""

from __future__ import annotations

import pytest

from tests.browser.camera import Drawing
from tests.browser.conftest import OpenPage
from tests.browser.server import AppServer
from tests.browser.sizes import PHONE, PORTRAIT

SHEETS = ("jog", "objects", "teach", "instruments", "help", "more")
CUT = """() => [...document.querySelectorAll("button, select, legend, label, h1, h2, summary")]
    .filter((each) => each.clientWidth && each.checkVisibility({ visibilityProperty: true }))
    .filter((each) => each.scrollWidth > each.clientWidth + 1
        || each.getBoundingClientRect().right > innerWidth + 1)
    .map((each) => each.textContent)"""
ENGLISH = """() => [...document.querySelectorAll("[lang=en]:not(option)")]
    .map((each) => each.textContent)"""
SHOWN = {
    "Axis 2 (shoulder) at its limit of −12.50°.": "Achse 2 (Schulter) an der Grenze von −12,50°.",
    "13:43:22: You pressed STOP.": "13:43:22: Sie haben STOPP gedrückt.",
    "Pour: line, step 4 of 7, 26 s left.": "Pour: Linie, Schritt 4 von 7, noch 26 s.",
    "Not run: Anna is away.": "Nicht ausgeführt: Anna is away.",
}
"""Words of server and page, and those that are shown in German."""

STOP = {"de": "STOPP", "fr": "ARRÊT", "zh": "停止"}


@pytest.mark.long
@pytest.mark.parametrize("language", STOP)
def test_page_on_a_phone_has_room_for_each_language(
    language: str, server: AppServer, open_page: OpenPage
) -> None:
    window = open_page(server.url, window=PORTRAIT, drawing=Drawing.NONE, locale=language, **PHONE)
    page = window.page
    page.wait_for_selector("html[data-translated]")
    for sheet in SHEETS:
        page.click(f"#{sheet}-button")
        page.wait_for_selector(f"#{sheet}")
        page.wait_for_load_state("networkidle")
        assert page.evaluate(CUT) == [], sheet
        assert page.evaluate(ENGLISH) == [], sheet
        page.click(f"#{sheet}-button")
    assert page.inner_text("#stop") == STOP[language]
    assert page.evaluate("document.documentElement.scrollWidth") == PORTRAIT[0]


@pytest.mark.parametrize(
    "language", ["fr", *(pytest.param(x, marks=pytest.mark.long) for x in ("de", "en"))]
)
def test_bar_of_a_stop_fits_into_windows_of_every_width(
    language: str, server: AppServer, open_page: OpenPage
) -> None:
    page = open_page(server.url, drawing=Drawing.NONE, locale=language).page
    page.click("#stop")
    page.wait_for_selector("#clear-stop:visible")
    for width in range(570, 1920, 30):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") == width


def test_language_is_chosen_in_the_menu_and_kept(server: AppServer, open_page: OpenPage) -> None:
    page = open_page(server.url, drawing=Drawing.NONE, locale="it-IT").page
    assert page.inner_text("#stop") == "STOP"
    page.click("#more-button")
    page.select_option("#language select", "de")
    page.wait_for_selector("html[lang=de][data-translated]")
    page.wait_for_function("document.querySelector('#holder').textContent === 'Niemand steuert'")
    assert page.inner_text("#jog [name=frame] + span >> nth=0") == "Basis"
    for words, shown in SHOWN.items():
        assert page.evaluate("(words) => translated(words)", words) == shown
