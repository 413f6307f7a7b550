"""Episodes on the page: by keyboard alone, by touch, in two windows, and over a reload."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import katana450
from katana450.extensions.recording.episodes.episode import EpisodeOutcome
from tests.browser.camera import Drawing
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import RECORDING_APP, AppServer
from tests.browser.session import bar
from tests.browser.sizes import PHONE, PORTRAIT, WIDE
from tests.browser.test_accessibility import findings
from tests.gateway.client import ask, enter

POSTURES = ((0.3, -1.0, 1.4, 0.3, 0.0), (-0.3, -1.0, 1.4, 0.3, 0.5))


@pytest.fixture
def server(tmp_path: Path) -> Iterator[AppServer]:
    folders = ("--record", str(tmp_path / "ring"), "--episodes", str(tmp_path / "episodes"))
    options = ("--silence", "2.0", *folders)
    with AppServer((*RECORDING_APP, *options)) as running:
        yield running


def move(server: AppServer, *postures: tuple[float, ...]) -> None:
    with katana450.connect(server.url, name="Driver") as arm:
        for posture in postures:
            arm.joints(posture)


def listed(server: AppServer) -> dict[str, Any]:
    """Return the episodes of the server, queried without a browser."""
    status, _, body = ask(f"{server.url}/api/v1/episodes", Cookie=enter(server.url))
    assert status == 200, body
    content: dict[str, Any] = json.loads(body)
    return content


def outcomes(server: AppServer) -> list[str]:
    return [row["outcome"] for row in listed(server)["episodes"]]


def ready(page: ViserPage) -> None:
    """Wait for the process that records."""
    page.page.wait_for_selector("#episodes-button:not([hidden])", timeout=30_000)


def rec(page: ViserPage) -> str:
    return bar(page, "episodes-button")


def recording(page: ViserPage) -> bool:
    return rec(page).startswith("REC 0:")


def toast(page: ViserPage, words: str) -> None:
    page.wait_until(lambda: words in bar(page, "toast"), f"the words {words!r}")


@pytest.mark.long
def test_whole_flow_by_keyboard_alone(
    open_page: OpenPage, recording_server: AppServer, recorded: Path, artefacts: Path
) -> None:
    server = recording_server
    page = open_page(server.url, window=WIDE, drawing=Drawing.NONE)
    ready(page)
    keys = page.page.keyboard
    page.page.focus("#episodes-button")
    keys.press("Enter")
    # The first field of the sheet takes the focus.
    page.wait_until(
        lambda: page.page.evaluate("document.activeElement.matches('#episodes input')"), "the focus"
    )
    keys.type("Pour the water")
    keys.press("Enter")
    toast(page, "Recording episode 1, by Window 1.")
    page.wait_until(lambda: rec(page).startswith("REC 0:0"), "the time in the bar")
    move(server, *POSTURES)
    page.wait_until(lambda: "kB" in rec(page), "the size in the bar")
    page.keep(artefacts / "episodes-running.png")
    # The focus has left the field, so the letter is not typed.
    keys.press("t")
    toast(page, "Y: success, N: failure, X: discard")
    assert outcomes(server) == ["unjudged"]
    keys.press("y")
    toast(page, "Episode 1: success")
    keys.press("n")
    page.wait_until(lambda: outcomes(server) == ["failure"], "the failure")
    keys.press("b")
    page.wait_until(lambda: rec(page).startswith("REC 0:0"), "the next attempt")
    move(server, *POSTURES)
    keys.press("y")
    page.wait_until(lambda: outcomes(server) == ["success"], "the success")
    keys.press("x")
    toast(page, "Episode 2 is discarded")
    page.wait_until(lambda: outcomes(server) == [], "the episode gone")
    # STOP is the same as ever.
    assert bar(page, "mode").startswith("On target")
    (path,) = (recorded / "episodes" / "discarded").glob("*2.mcap")
    assert path.name == "episode-0002.mcap"
    (episode,) = katana450.open(path).episodes
    assert episode.task == "Pour the water"
    assert episode.outcome is EpisodeOutcome.SUCCESS
    assert page.errors == []


@pytest.mark.long
def test_whole_flow_on_a_phone(open_page: OpenPage, server: AppServer, artefacts: Path) -> None:
    page = open_page(server.url, drawing=Drawing.NONE, window=PORTRAIT, **PHONE)
    ready(page)
    sheet = page.page.locator("#episodes")
    page.page.tap("#episodes-button")
    # The keyboard of the phone must not cover the button.
    assert page.page.evaluate("document.activeElement.tagName") != "INPUT"
    tap(page, "Start an episode")
    toast(page, "Recording episode 1")
    move(server, *POSTURES)
    page.keep(artefacts / "episodes-phone-running.png")
    assert_fits(page)
    assert findings(page.page) == []
    tap(page, "Success")
    page.wait_until(lambda: outcomes(server) == ["success"], "the success")
    sheet.locator("summary").first.tap()
    page.keep(artefacts / "episodes-phone-list.png")
    assert_fits(page)
    note = sheet.get_by_label("Note")
    note.tap()
    note.fill("a little spilled")
    sheet.get_by_label("To, s").tap()
    page.wait_until(lambda: listed(server)["episodes"][0]["note"] == "a little spilled", "the note")
    sheet.get_by_label("To, s").fill("1.0")
    sheet.get_by_label("From, s").tap()
    page.wait_until(lambda: listed(server)["episodes"][0]["end"] == 1.0, "the end")
    sheet.get_by_label("Outcome").select_option("failure")
    page.wait_until(lambda: outcomes(server) == ["failure"], "the failure")
    tap(page, "Discard")
    page.wait_until(lambda: len(listed(server)["discarded"]) == 1, "the discarded one")
    page.wait_until(lambda: sheet.locator(".gone").count() == 1, "it in the list")
    page.keep(artefacts / "episodes-phone-discarded.png")
    sheet.get_by_role("button", name="Restore episode 1").tap()
    page.wait_until(lambda: outcomes(server) == ["failure"], "the episode again")
    assert page.errors == []


def tap(page: ViserPage, name: str) -> None:
    page.page.locator("#episodes").get_by_role("button", name=name).first.tap()


def assert_fits(page: ViserPage) -> None:
    """Check that a finger hits every control, and that nothing is cut or scrolled sideways."""
    small = page.page.evaluate(
        """() => [...document.querySelectorAll(
          "#episodes-button, #episodes :is(button, input, select, summary, a)")]
          .filter((each) => each.offsetParent && each.getBoundingClientRect().height < 43.9)
          .map((each) => each.textContent || each.outerHTML)"""
    )
    assert small == []
    cut = page.page.evaluate(
        "() => [...document.querySelectorAll('nav button:not([hidden])')].filter((each) =>"
        " each.scrollWidth > each.clientWidth + 1"
        " || each.getBoundingClientRect().right > innerWidth - 12).map((each) => each.textContent)"
    )
    assert cut == []
    assert page.page.evaluate(
        "() => { const each = document.getElementById('episodes');"
        " return each.scrollWidth <= each.clientWidth + 1 }"
    )


@pytest.mark.long
def test_windows_agree_and_a_reload_keeps_rec(
    open_page: OpenPage, server: AppServer, artefacts: Path
) -> None:
    first, second = (open_page(server.url, drawing=Drawing.NONE, window=WIDE) for _ in range(2))
    for page in (first, second):
        ready(page)
    first.page.keyboard.press("t")
    for page in (first, second):
        toast(page, "Recording episode 1, by Window 1")
        page.wait_until(partial(recording, page), "REC")
    move(server, *POSTURES)
    first.page.reload()
    first.wait_until(lambda: rec(first).startswith("REC 0:"), "REC after the reload")
    # The other window ends it.
    second.page.click("#episodes-button")
    second.page.click("#jog-button")
    second.page.wait_for_selector("#jog [name=step]", state="attached")
    second.press_in_bar("Success")
    second.wait_until(lambda: outcomes(server) == ["success"], "the success")
    first.wait_until(lambda: rec(first) == "REC", "the end")
    second.page.locator("#episodes summary").first.click()
    second.keep(artefacts / "episodes-desk.png")
    assert findings(second.page) == []
    assert second.page.locator("#episodes i.success").inner_text() == "Success"
    # While Jog is open, its keys move the arm, and those of episodes are others.
    second.page.focus("#jog-button")
    second.page.keyboard.press("x")
    first.page.click("#episodes-button")
    first.wait_until(lambda: first.page.locator("#episodes .gone").count() == 1, "the discarded")
    assert first.errors == second.errors == []


@pytest.mark.long
def test_episodes_are_open_again_without_taking_the_keys(
    recording_server: AppServer, open_page: OpenPage
) -> None:
    window = open_page(recording_server.url, window=WIDE, drawing=Drawing.NONE)
    ready(window)
    page = window.page
    page.click("#episodes-button")
    page.locator("#episodes").wait_for()
    page.reload()
    page.locator("#episodes").wait_for()
    # In a field, Space would type a blank and not stop the arm.
    assert page.evaluate("() => document.activeElement === document.body")
