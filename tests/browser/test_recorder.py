"""The page saves what the server has just recorded, and says why if it cannot."""

from __future__ import annotations

from pathlib import Path

import pytest

import katana450
from tests.browser.conftest import OpenPage
from tests.browser.server import APP, RECORDING_APP, AppServer
from tests.browser.session import bar
from tests.browser.sizes import PHONE, PORTRAIT, WIDE

pytestmark = pytest.mark.long


def test_menu_saves_the_recording(open_page: OpenPage, tmp_path: Path, artefacts: Path) -> None:
    command = (*RECORDING_APP, "--silence", "2.0", "--record", str(tmp_path / "ring"))
    with AppServer(command) as server:
        page = open_page(server.url, nodes=("/arm",))
        with katana450.connect(server.url, name="Driver") as arm:
            arm.joints((0.3, -1.0, 1.4, 0.3, 0.0))
        page.wait_until(lambda: list((tmp_path / "ring").glob("*.mcap")), "a file", seconds=30.0)
        page.page.wait_for_timeout(2500)
        page.page.click("#more-button")
        page.keep(artefacts / "save-recording.png")
        with page.page.expect_download() as downloading:
            page.press_in_bar("Save the last 10 minutes")
        assert downloading.value.suggested_filename.endswith(".mcap")
        downloading.value.save_as(tmp_path / "run.mcap")
    recording = katana450.open(tmp_path / "run.mcap")
    assert recording.verify().identical
    assert abs(recording.q[-1][0] - 0.3) < 1e-9


@pytest.mark.parametrize("size", ["desk", "phone"])
def test_menu_is_as_wide_as_its_words(open_page: OpenPage, size: str, artefacts: Path) -> None:
    window, options = {"desk": (WIDE, {}), "phone": (PORTRAIT, PHONE)}[size]
    with AppServer((*APP,)) as server:
        page = open_page(server.url, nodes=("/arm",), window=window, **options)
        page.page.click("#more-button")
        page.keep(artefacts / f"menu-{size}.png")
        cut = page.page.evaluate(
            "() => [...document.querySelectorAll('#more, #more button')]"
            ".filter((each) => each.scrollWidth > each.clientWidth + 1).map((each) => each.id)"
        )
    assert cut == []


def test_page_says_that_a_server_records_nothing(open_page: OpenPage) -> None:
    with AppServer((*APP,)) as server:
        page = open_page(server.url, nodes=("/arm",))
        page.page.click("#more-button")
        page.press_in_bar("Save the last 10 minutes")
        page.wait_until(lambda: "records nothing" in bar(page, "toast"), "the reason")
