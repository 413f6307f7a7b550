"""The tab Programs with a UR5e: a script of lines and a circle, STOP, undo and a lost server."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import MOVE, Truth, clear_stop, take
from tests.browser.sizes import PHONE, PORTRAIT, WIDE
from tests.browser.teach_sheet import kept, open_sheet, press, reload, rows, says
from tests.general_arms.links_of_arms import ur5e

pytestmark = pytest.mark.long

SCRIPT = """name: Lines and circle
frame: shoulder
speed: 0.15
steps:
  - line: {by: {z: 60}}
  - circle: {centre: [CENTRE], normal: x, radius: 40}
  - line: {by: {y: 100}}
"""
ASK_MILLISECONDS = 150.0

PLANNED = 60.0
"""Timeout of a plan [s], on a busy machine."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[AppServer]:
    path = tmp_path / "ur5e.urdf"
    path.write_text(ur5e(), encoding="utf-8")
    (tmp_path / "other arm.yaml").write_text(SCRIPT.replace("CENTRE", "0, 0, 0"), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(path), "--programs", str(tmp_path))) as server:
        yield server


def progress(truth: Truth) -> Any:
    return truth.status().get("program", {"status": "", "why": ""})


def wait(page: ViserPage, truth: Truth, status: str, seconds: float = PLANNED) -> None:
    """Wait for a status of the program; ask seldom, because two windows ask as well."""
    deadline = time.monotonic() + seconds
    while progress(truth)["status"] != status:
        assert time.monotonic() < deadline, f"waited {seconds:g} s: {progress(truth)}"
        page.page.wait_for_timeout(ASK_MILLISECONDS)


def at_rest(page: ViserPage, truth: Truth) -> Any:
    """Wait until the arm is at rest, and return its joint angles."""
    deadline = time.monotonic() + 20.0
    while truth.status()["moving"]:
        assert time.monotonic() < deadline, truth.status()
        page.page.wait_for_timeout(ASK_MILLISECONDS)
    return truth.status()["q"]


def test_script_is_previewed_paused_stopped_by_a_phone_and_continued(
    server: AppServer, tmp_path: Path, open_page: OpenPage, artefacts: Path
) -> None:
    truth = Truth(server)
    page = open_page(server.url, nodes=("/arm", MOVE), window=WIDE)
    phone = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, own_camera=True, **PHONE)
    take(page)
    # The centre is below the tool at the end of the first line.
    x, y, z = (1e3 * np.array(truth.status()["T"])[:3, 3]).tolist()
    text = SCRIPT.replace("CENTRE", f"{x:.6f}, {y:.6f}, {z + 20:.6f}")
    (tmp_path / "other arm.yaml").write_text(text, encoding="utf-8")
    page.open_tab("Programs")
    page.choose("Script", "other arm")
    page.click_button("Preview")
    wait(page, truth, "ready")
    assert progress(truth)["steps"] == 3
    before = truth.status()["q"]
    page.drag_slider("Look at", 2.0)
    page.keep(artefacts / "other-arm-preview.png")
    # A preview moves nothing.
    assert truth.status()["q"] == before

    page.click_button("Run")
    wait(page, truth, "running")
    page.page.wait_for_timeout(700)
    page.press_in_bar("Pause")
    wait(page, truth, "paused")
    paused = at_rest(page, truth)
    assert paused != before
    # A press just after the button changed may have meant Pause, and is ignored.
    page.page.get_by_role("button", name="Resume", exact=True).wait_for()
    page.page.wait_for_timeout(800)
    assert truth.status()["q"] == paused
    page.press_in_bar("Resume")
    wait(page, truth, "running")
    page.page.wait_for_timeout(500)
    phone.page.locator("#stop").tap()
    page.page.locator("#headline", has_text="Stopped").wait_for()
    stopped = at_rest(page, truth)
    assert truth.status()["stop"] == "confirmed"
    phone.keep(artefacts / "other-arm-stopped.png")
    clear_stop(page, truth)
    page.page.wait_for_timeout(600)
    assert truth.status()["q"] == stopped

    page.page.get_by_role("button", name="Continue ").click()
    wait(page, truth, "done", 90.0)
    at_rest(page, truth)
    end = 1e3 * np.array(truth.status()["T"])[:3, 3]
    np.testing.assert_allclose(end, [x, y + 100.0, z + 60.0], atol=1e-6)
    assert page.errors == []
    assert phone.errors == []


def test_taught_poses_of_six_axes_return_after_a_reload(
    server: AppServer, open_page: OpenPage
) -> None:
    # A list of five joints, as earlier versions kept it for every arm.
    five = '{"format": 1, "name": "Old", "times": 1, "poses": [], "text": null}'
    keep = f"localStorage.setItem('katana450.teach', '{five}');"
    page = open_page(server.url, nodes=("/arm", MOVE), window=WIDE, script=keep)
    take(page)
    open_sheet(page)
    assert page.page.get_by_label("Name", exact=True).input_value() == "My script"
    press(page, "Add pose")
    page.wait_until(lambda: rows(page).count() == 1, "a pose")
    (pose,) = kept(page)["poses"]
    assert len(pose["joints"]) == 6
    again = reload(page)
    assert rows(again).count() == 1
    assert "cannot be read" not in says(again)
    press(again, "Add pose")
    again.wait_until(lambda: rows(again).count() == 2, "another pose")
    assert kept(again)["poses"][0] == pose
    assert again.page.evaluate("localStorage.getItem('katana450.teach')") == five
    assert again.errors == []
