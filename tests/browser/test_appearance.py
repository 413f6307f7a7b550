"""Cameras and themes change only the display of one window."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.server.view.cameras import AHEAD
from katana450.server.viser_bridge.presets import CAMERA_POSES, Preset
from katana450.server.viser_bridge.themes import DARK, LIGHT
from katana450.settings import Settings
from tests.browser.conftest import Windows
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import bar, turn

READY = np.array(Settings().ready)
MOVE = "/target/move"


def seen_from(page: ViserPage) -> tuple[FloatArray, FloatArray]:
    """Return position and target of the camera in the base frame [m]."""
    view = page.sent("ViewerCameraMessage")[-1].body
    return np.array(view["position"]), np.array(view["look_at"])


def wait_for_look(page: ViserPage, position: FloatArray, target: FloatArray) -> None:
    page.wait_until(
        lambda: np.allclose(np.stack(seen_from(page)), [position, target], atol=1e-3),
        f"a camera at {position}",
    )


@pytest.fixture(scope="module")
def pair(windows: Windows) -> Iterator[tuple[ViserPage, ViserPage]]:
    """Return two windows of one server."""
    with (
        AppServer() as server,
        windows.open(server.url, nodes=("/arm", MOVE)) as page,
        windows.open(server.url, nodes=("/arm", MOVE)) as other,
    ):
        yield page, other


@pytest.mark.long
def test_each_window_looks_from_where_its_person_asks(
    pair: tuple[ViserPage, ViserPage], arm: MountedArm, artefacts: Path
) -> None:
    chain = arm.chain
    page, other = pair
    others = seen_from(other)
    for preset, look in CAMERA_POSES.items():
        turn(page, preset.value)
        wait_for_look(page, np.array(look.position), np.array(look.target))
        page.keep(artefacts / f"look-{preset.value.lower()}.png")

    turn(page, Preset.TOOL.value)

    def on_tool(q: FloatArray) -> FloatArray:
        T = arm.T_base_shoulder @ forward(chain, q)
        ahead: FloatArray = T[:3, 3] + AHEAD * T[:3, 0]
        return ahead

    page.wait_until(lambda: np.allclose(seen_from(page)[1], on_tool(READY), atol=1e-3), "it")
    page.keep(artefacts / "look-tool.png")
    page.click_button("Go to zero")
    page.wait_until(
        lambda: np.allclose(seen_from(page)[1], on_tool(np.zeros(5)), atol=1e-3),
        "the camera to ride along",
    )
    # The gizmo of the stretched arm would be cut off: same direction, from farther away.
    turn(page, Preset.SIDE.value)
    side = np.array(CAMERA_POSES[Preset.SIDE].position)

    def from_the_side() -> bool:
        position, target = seen_from(page)
        away = position - target
        return position[1] < side[1] and np.allclose(away, [0.0, away[1], away[2]], atol=1e-3)

    page.wait_until(from_the_side, "a camera at the side")
    fitted = np.stack(seen_from(page))
    page.click_button("Home")
    page.wait_until(lambda: "Moving" not in bar(page, "headline"), "the arm to arrive")
    assert np.allclose(np.stack(seen_from(page)), fitted, atol=1e-3)
    assert np.allclose(np.stack(seen_from(other)), np.stack(others), atol=1e-3)
    assert page.errors == other.errors == []


@pytest.mark.long
def test_a_theme_is_of_one_window(pair: tuple[ViserPage, ViserPage], artefacts: Path) -> None:
    page, other = pair

    def sky(window: ViserPage) -> FloatArray:
        patch = window.picture()[90:110, 500:540].reshape(-1, 3)
        return np.asarray(np.median(patch, axis=0), dtype=float)

    page.open_tab("Scene")
    page.click_button("Dark")
    page.wait_until(lambda: sky(page).max() < max(DARK.floor) + 30, "the night", seconds=20.0)
    page.keep(artefacts / "look-dark.png")
    assert sky(other).min() > min(LIGHT.floor) - 40
    page.click_button("Light")
    page.wait_until(lambda: sky(page).min() > min(LIGHT.floor) - 40, "the day")
    assert page.errors == other.errors == []


@pytest.mark.long
def test_a_window_is_as_its_system_until_its_person_chooses(
    pair: tuple[ViserPage, ViserPage],
) -> None:
    chose, other = pair

    def themes(window: ViserPage) -> tuple[str, str]:
        """Return the theme of the page and that of viser's page in it."""
        return (
            window.page.evaluate("() => document.documentElement.dataset.theme"),
            window.frame.evaluate("() => document.documentElement.dataset.mantineColorScheme"),
        )

    chose.open_tab("Scene")
    chose.click_button("Light")
    for window in pair:
        window.page.emulate_media(color_scheme="dark")
    other.wait_until(lambda: themes(other) == ("dark", "dark"), "the night of the system")
    other.page.emulate_media(color_scheme="light")
    other.wait_until(lambda: themes(other) == ("light", "light"), "the day of the system")
    assert themes(chose) == ("light", "light")
    assert chose.errors == other.errors == []
