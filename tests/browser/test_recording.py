"""A recording in one file works without a network: its slider moves the arm."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page

from katana450.cli.main import main
from tests.browser.page import SCRIPTS

pytestmark = pytest.mark.long

PAN = "/arm/base_link/arm_base_link/pan_link"

SECONDS, TURN = 4.0, 1.2
"""Duration [s] of the motion, and angle [rad] by which axis 1 turns."""

TRACK = ".mantine-Slider-trackContainer"

FAINTEST = """() => {
  const canvas = document.querySelector('canvas[data-engine]');
  canvas.style.opacity = '0.05';
  return getComputedStyle(canvas).opacity;
}"""
"""Script that returns the opacity of the picture while viser would draw it faintly."""

COUNT_IMAGES = """
  window.images = 0;
  const made = URL.createObjectURL;
  URL.createObjectURL = (blob) => {
    window.images += Number(blob.type === 'image/jpeg');
    return made.call(URL, blob);
  };
"""
"""Script that counts decoded images; the light of the room is one of them."""

GRIPPER = f"{PAN}/upper_arm_link/forearm_link/wrist_link/roll_link/gripper_link"

IN_PICTURE = """(name) => {
  const { camera, canvas, nodeRefFromName } = window.__viserMutable;
  const node = nodeRefFromName[name];
  if (!node) return false;
  const { x, y } = node.getWorldPosition(camera.position.clone()).project(camera);
  return Math.abs(x) < 0.85 && Math.abs(y) < 0.85;
}"""
"""Script that returns whether the origin of a node is in the picture, away from its edge."""

NOW = "() => Number(document.querySelector('[role=slider]').getAttribute('aria-valuenow'))"


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    table = tmp_path / "m.csv"
    table.write_text(
        f"t,theta1,theta2,theta3,theta4\n0,0,-1.19,1.48,0.14\n{SECONDS},{TURN},-1.19,1.48,0.14\n"
    )
    path = tmp_path / "turn.html"
    assert main(["export", "html", "--out", str(path), "--trajectory", str(table)]) == 0
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
        assert page.evaluate(FAINTEST) == "1"
        assert page.locator("#caption").inner_text() == "katana450: m, 4.0 s"
        page.get_by_role("button", name="Pause").click()
        for fraction in (0.2, 0.9, 0.5):
            box = page.locator(TRACK).bounding_box()
            assert box is not None
            page.mouse.click(box["x"] + fraction * box["width"], box["y"] + 0.5 * box["height"])
            page.wait_for_timeout(500)
            t = float(page.evaluate(NOW))
            assert t == pytest.approx(fraction * SECONDS, abs=0.15)
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


def test_recording_keeps_its_brightness_after_seeking(browser: Browser, recording: Path) -> None:
    """The light of the room is decoded only once, not after every step backwards."""
    page = browser.new_page(viewport={"width": 480, "height": 320})
    page.add_init_script(COUNT_IMAGES)
    try:
        page.goto(f"{recording.as_uri()}?fixedDpr=0.5")
        assert page.title() == "katana450: m"
        page.wait_for_function("n => window.__viserMutable?.nodeRefFromName[n]", arg=PAN)
        page.wait_for_function("() => window.images > 0")
        page.locator("button").first.click()
        before = settled_brightness(page)
        images = page.evaluate("() => window.images")
        for fraction in (0.8, 0.1, 0.6, 0.3):
            box = page.locator(TRACK).bounding_box()
            assert box is not None
            page.mouse.click(box["x"] + fraction * box["width"], box["y"] + 0.5 * box["height"])
            page.wait_for_timeout(300)
            assert brightness(page) == pytest.approx(before, rel=0.1)
        assert page.evaluate("() => window.images") == images
    finally:
        page.close()


def test_page_of_one_pose_has_no_slider(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "pose.html"
    assert main(["export", "html", "--out", str(path)]) == 0
    page = browser.new_page(viewport={"width": 480, "height": 320})
    try:
        page.goto(f"{path.as_uri()}?fixedDpr=0.5")
        page.wait_for_function("n => window.__viserMutable?.nodeRefFromName[n]", arg=PAN)
        assert page.locator("#caption").inner_text() == "katana450: one pose"
        assert not page.locator(TRACK).is_visible()
    finally:
        page.close()


def test_narrow_picture_shows_the_whole_arm(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "pose.html"
    zero = ["--pose", "0,0,0,0,0"]
    assert main(["export", "html", "--out", str(path), *zero]) == 0
    page = browser.new_page(viewport={"width": 390, "height": 844})
    try:
        page.goto(f"{path.as_uri()}?fixedDpr=0.5")
        page.wait_for_function("n => window.__viserMutable?.nodeRefFromName[n]", arg=PAN)
        page.wait_for_function(IN_PICTURE, arg=GRIPPER)
    finally:
        page.close()


def brightness(page: Page) -> float:
    """Return the mean brightness of the scene, 0 to 255."""
    shot = page.locator("canvas[data-engine]").screenshot()
    return float(np.asarray(Image.open(io.BytesIO(shot)).convert("L")).mean())


def settled_brightness(page: Page) -> float:
    """Return the brightness of a picture that no longer changes."""
    last = brightness(page)
    for _ in range(60):
        page.wait_for_timeout(500)
        now = brightness(page)
        if abs(now - last) < 0.5:
            return now
        last = now
    return last


def pan(page: Page) -> float:
    """Return the angle [rad] of axis 1 on the page."""
    found = page.evaluate("name => harness.poses(name)", PAN)
    node, root = (np.reshape(found[key], (4, 4)).T for key in ("node", "root"))
    R = (np.linalg.inv(root) @ node)[:3, :3]
    return math.atan2(R[1, 0], R[0, 0])
