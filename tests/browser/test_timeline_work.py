"""The timeline verifies and exports the selection, shows the progress, and cancels."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.client import connect
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import RECORDING_APP, AppServer
from tests.browser.sight import overlap
from tests.browser.sizes import PHONE, SIZES, WIDE, in_sizes_and_schemes

MAX_SECONDS = 60_000
"""[ms] Timeout of a short job on a busy machine."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AppServer]:
    """Return a server whose arm has turned."""
    folder = tmp_path_factory.mktemp("ring")
    with AppServer((*RECORDING_APP, "--record", str(folder))) as server:
        with connect(server.url, "Ada") as arm:
            for angle in (0.6, -0.6):
                arm.joints((angle, -1.0, 1.4, 0.3, 0.0))
        time.sleep(2.0)
        yield server


def opened(page: ViserPage) -> None:
    """Show the timeline of ``page`` with something on it."""
    page.page.click("#more-button")
    page.press_in_bar("Timeline")
    page.page.wait_for_function("() => Number(document.querySelector('#timeline .now')?.max) > 2")


@pytest.mark.long
def test_selection_is_verified_exported_and_cancelled(
    server: AppServer, open_page: OpenPage, tmp_path: Path, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=WIDE)
    opened(page)
    row = page.page.locator("#timeline .work")
    assert not row.is_visible()
    verify = page.page.get_by_role("button", name=re.compile("^Verify the selection"))
    verify.click()
    row.get_by_role("button", name="Cancel").wait_for()
    page.keep(artefacts / "timeline-verifying.png")
    row.get_by_text("identical to the bit over").wait_for(timeout=MAX_SECONDS)
    page.keep(artefacts / "timeline-verified.png")
    row.get_by_role("button", name="Close").click()
    assert not row.is_visible()

    exports = page.page.get_by_label("Export the selection")
    with page.page.expect_download(timeout=MAX_SECONDS) as downloading:
        exports.select_option(label="CSV table")
    downloading.value.save_as(tmp_path / "run.csv")
    lines = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("t,theta1")
    assert len(lines) > 100
    row.get_by_text(f"Exported katana450.csv: {len(lines) - 1} rows.").wait_for()
    assert exports.input_value() == ""

    exports.select_option(label="HTML page")
    row.get_by_role("button", name="Cancel").click()
    assert not row.is_visible()
    # The server is free for the next one.
    verify.click()
    row.get_by_text("identical to the bit over").wait_for(timeout=MAX_SECONDS)
    assert page.errors == []


@pytest.mark.long
@in_sizes_and_schemes(("wide", "portrait", "landscape"))
def test_progress_covers_nothing(
    server: AppServer, open_page: OpenPage, artefacts: Path, size: str, scheme: str
) -> None:
    options = {} if size == "wide" else PHONE
    page = open_page(
        server.url, nodes=("/arm",), window=SIZES[size], color_scheme=scheme, **options
    )
    opened(page)
    page.page.get_by_role("button", name=re.compile("^Verify the selection")).click()
    row = page.page.locator("#timeline .work")
    row.get_by_text("identical to the bit over").wait_for(timeout=MAX_SECONDS)
    page.keep(artefacts / f"timeline-work-{size}-{scheme}.png")
    box = row.bounding_box()
    assert box is not None
    for name in ("#stop", "#scene", "#timeline .row"):
        other = page.page.locator(name).bounding_box()
        assert other is not None
        assert not overlap(box, **other), name
    heights = page.page.locator("#timeline button:visible").evaluate_all(
        "(all) => all.map((each) => each.getBoundingClientRect().height)"
    )
    assert min(heights) >= (32.0 if size == "wide" else 44.0) - 0.5
    assert page.errors == []
