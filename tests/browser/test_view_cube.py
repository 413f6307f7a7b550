"""The view cube, Fit, and the double-click that looks at a point."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.server.viser_bridge.presets import CAMERA_POSES, Preset
from tests.browser.camera import Camera
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, camera, turn

FACES = {"front": Preset.FRONT, "back": Preset.BACK, "left": Preset.LEFT, "right": Preset.SIDE}
OUT = {"front": (1, 0, 0), "back": (-1, 0, 0), "left": (0, 1, 0), "right": (0, -1, 0)}
UP = (0, 0, 1)
CENTRE = (0.0, 0.0, 0.3)


@pytest.fixture
def page(server: AppServer, open_page: OpenPage) -> ViserPage:
    page = open_page(server.url, nodes=("/arm", MOVE))
    page.page.wait_for_selector("#cube")
    return page


def unit(vector: Any) -> Any:
    return vector / np.linalg.norm(vector)


def away(page: ViserPage) -> Any:
    """Return the vector from the target of the camera to the camera [m]."""
    position, target = camera(page)
    return position - target


def face(page: ViserPage, name: str) -> tuple[float, float]:
    """Return the middle of a face of the cube [px]."""
    box = page.page.get_by_role("group", name="Camera").get_by_label(f"View: {name}").bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def wait_from(page: ViserPage, preset: Preset) -> None:
    """Wait until the camera looks in the direction of a preset; it may be fitted."""
    look = CAMERA_POSES[preset]
    direction = np.subtract(look.target, look.position)

    def there() -> bool:
        position, target = camera(page)
        return bool(np.allclose(unit(target - position), unit(direction), atol=0.02))

    page.wait_until(there, f"the view {preset.value}")


@pytest.mark.long
def test_cube_shows_how_the_scene_is_seen(page: ViserPage) -> None:
    for position in ((0.9, -0.8, 0.7), (-0.9, 0.6, 0.4), (0.5, 1.0, 0.9)):
        page.look_from(Camera(position, CENTRE))
        page.settled(lambda: camera(page), "the camera")
        origin, top = page.project(CENTRE), face(page, "top")
        middle = np.mean([face(page, "front"), face(page, "back")], axis=0)
        for name, out in [*OUT.items(), ("top", UP)]:
            shown = np.subtract(top if name == "top" else face(page, name), middle)
            offset = np.subtract(page.project(np.add(np.multiply(out, 0.02), CENTRE)), origin)
            across = np.linalg.norm(shown) * np.linalg.norm(offset)
            assert float(shown @ offset) / across > 0.97, (position, name)


@pytest.mark.long
def test_faces_turn_the_camera_by_mouse_and_by_keys(page: ViserPage, artefacts: Path) -> None:
    turn(page, "3D")
    wait_from(page, Preset.FREE)
    page.keep(artefacts / "view-cube.png")
    page.page.mouse.click(*face(page, "right"))
    wait_from(page, Preset.SIDE)
    turn(page, "3D")
    wait_from(page, Preset.FREE)
    page.page.mouse.click(*face(page, "top"))
    wait_from(page, Preset.TOP)
    # The keyboard also reaches the faces that point away.
    camera_group = page.page.get_by_role("group", name="Camera")
    for name, preset in FACES.items():
        camera_group.get_by_role("button", name=f"View: {name}").focus()
        page.page.keyboard.press("Enter")
        wait_from(page, preset)
    # Views are of this window only, so they need no lease.
    assert page.page.inner_text("#holder") == "Nobody drives"
    assert page.errors == []


@pytest.mark.long
def test_fit_fills_the_picture_with_the_arm(page: ViserPage) -> None:
    direction = unit((1.0, -2.0, 0.8))
    for distance in (4.0, 0.6):
        page.look_from(Camera(tuple(3 * [0.2] + distance * direction), (0.2, 0.2, 0.2)))
        page.settled(lambda: camera(page), "the camera")
        page.page.get_by_role("button", name="Fit", exact=True).click()
        page.wait_until(lambda: 0.7 < np.linalg.norm(away(page)) < 2.5, "the fit")
        page.settled(lambda: camera(page), "the camera")
        assert np.allclose(unit(away(page)), direction, atol=1e-2)
        box = page.frame.locator("canvas").first.bounding_box()
        assert box is not None
        low = page.project((0.0, 0.0, 0.0))
        tip = page.project(page.node_pose(MOVE)[:3, 3])
        for x, y in (low, tip):
            assert box["x"] < x < box["x"] + box["width"]
            assert box["y"] < y < box["y"] + box["height"]


@pytest.mark.long
def test_double_click_looks_at_a_point(page: ViserPage) -> None:
    turn(page, "3D")
    wait_from(page, Preset.FREE)
    before = page.settled(lambda: camera(page), "the camera")
    cup = page.node_pose("/cup")[:3, 3] + (0.0, 0.0, 0.05)
    page.page.mouse.dblclick(*page.project(cup))
    page.wait_until(lambda: np.linalg.norm(camera(page)[1] - cup) < 0.06, "the cup in the middle")
    after = camera(page)
    assert np.allclose(unit(before[1] - before[0]), unit(after[1] - after[0]), atol=1e-3)
    assert np.linalg.norm(after[1] - after[0]) < 0.61
    # A double-click on nothing changes nothing.
    page.page.mouse.dblclick(60, 160)
    page.page.wait_for_timeout(200)
    assert np.allclose(camera(page), after, atol=1e-3)
