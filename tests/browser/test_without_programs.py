"""The page of a server without the extension ``programs`` works and offers no programs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.browser.conftest import OpenPage
from tests.browser.server import RECORDING_APP, AppServer
from tests.browser.session import bar, mood, take
from tests.extensions.environments import without


@pytest.fixture
def server(tmp_path: Path) -> Iterator[AppServer]:
    # Recording needs programs too, so its options are missing.
    command = (*RECORDING_APP, "--strict-silence", "--silence", "2.0")
    with without(tmp_path, "programs"), AppServer(command) as server:
        yield server


@pytest.mark.long
def test_page_drives_stops_and_offers_no_programs(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", "/target/move"))
    take(page)
    page.drag_slider("1 base turn", 20.0)
    page.wait_until(lambda: bar(page, "headline") == "On target", "the arm to arrive")
    page.page.keyboard.press("Space")
    page.wait_until(lambda: mood(page.page) == "stopped", "the stop")
    page.press_in_bar("Clear stop")
    page.wait_until(lambda: mood(page.page) == "ok", "the stop to be cleared")
    assert page.page.locator("#orders button").count() == 0
    assert page.tabs() == ["Drive", "Scene"]
    page.keep(artefacts / "without-programs.png")
    assert page.errors == []
