"""A recording in one file works without a network: its slider moves the arm."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from katana450.assembly.robot_session import find_robot
from katana450.extensions.export.page import FPS, recorded
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.browser.page import SCRIPTS

pytestmark = pytest.mark.long

PAN = "/arm/base_link/arm_base_link/pan_link"

SECONDS, TURN = 4.0, 1.2
"""Duration [s] of the motion, and angle [rad] by which axis 1 turns."""

TRACK = ".mantine-Slider-trackContainer"

NOW = "() => Number(document.querySelector('[role=slider]').getAttribute('aria-valuenow'))"


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    robot, session, _ = find_robot(Settings(), URDF_PATH, None)
    count = round(FPS * SECONDS)
    turned = session.ready + np.outer(np.linspace(0.0, 1.0, count + 1), (TURN, 0, 0, 0, 0))
    states = [session.begin(q, 0.0, number / FPS) for number, q in enumerate(turned)]
    path = tmp_path / "turn.html"
    path.write_text(recorded(robot, session, states, 1.0 / FPS, "katana450: m"), "utf-8")
    return path


def test_the_slider_moves_the_arm_without_a_network(browser: Browser, recording: Path) -> None:
    context = browser.new_context(viewport={"width": 640, "height": 420}, offline=True)
    scripts = "\n".join(script.read_text(encoding="utf-8") for script in SCRIPTS)
    options = json.dumps({"draws": False, "fullQuality": False})
    context.add_init_script(f"window.harness = {options};\n{scripts}")
    page = context.new_page()
    requested: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: requested.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    try:
        page.goto(f"{recording.as_uri()}?fixedDpr=0.5")
        page.locator("[role=slider]").wait_for(state="attached", timeout=60_000)
        page.wait_for_function("n => window.__viserMutable?.nodeRefFromName[n]", arg=PAN)
        assert page.locator("#caption").inner_text() == "katana450: m, 4.0 s"
        page.get_by_role("button", name="Pause").click()
        for fraction in (0.2, 0.9, 0.5):
            box = page.locator(TRACK).bounding_box()
            assert box is not None
            page.mouse.click(box["x"] + fraction * box["width"], box["y"] + 0.5 * box["height"])
            shown = f"(t) => Math.abs(({NOW})() - t) < 0.15"
            page.wait_for_function(shown, arg=fraction * SECONDS)
            t = float(page.evaluate(NOW))
            assert pan(page) == pytest.approx(TURN * t / SECONDS, abs=0.02)
        # A seek while it plays does not pause it, also backwards.
        page.get_by_role("button", name="Play").click()
        page.wait_for_function(f"() => ({NOW})() > {0.55 * SECONDS}")
        box = page.locator(TRACK).bounding_box()
        assert box is not None
        page.mouse.click(box["x"] + 0.1 * box["width"], box["y"] + 0.5 * box["height"])
        page.wait_for_function(f"() => ({NOW})() < {0.3 * SECONDS}")
        page.wait_for_function(f"() => ({NOW})() > {0.5 * SECONDS}")
        page.get_by_role("button", name="Pause").wait_for()
        assert not errors
        assert all(url.startswith(("file:", "blob:", "data:")) for url in requested)
    finally:
        context.close()


def pan(page: Page) -> float:
    """Return the angle [rad] of axis 1 on the page."""
    poses = page.evaluate("name => harness.poses(name)", PAN)
    node, root = (np.reshape(poses[key], (4, 4)).T for key in ("node", "root"))
    R = (np.linalg.inv(root) @ node)[:3, :3]
    return math.atan2(R[1, 0], R[0, 0])
