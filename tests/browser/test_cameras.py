"""Cameras over the scene: pictures with their age, grey when they are old. Without viser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from tests.browser.camera import Drawing
from tests.browser.conftest import Windows
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.sizes import PORTRAIT
from tests.browser.test_accessibility import findings
from tests.cameras.mjpeg_camera import MjpegCamera

SECONDS = 20_000
"""[ms] Timeout of each step: other programs may keep the machine busy."""

RED_OF_BAR = """() => {
  const canvas = document.querySelector("#cameras canvas");
  if (!canvas.width || canvas.hidden) return null;
  const data = canvas.getContext("2d").getImageData(0, 240, canvas.width, 1).data;
  for (let x = 0; x < canvas.width; x++) if (data[4 * x] > 150 && data[4 * x + 1] < 90) return x;
  return null;
}"""
"""Column in which the bar of the picture begins."""


@pytest.fixture(scope="module")
def camera() -> Iterator[MjpegCamera]:
    with MjpegCamera() as running:
        yield running


@pytest.fixture
def page(windows: Windows, camera: MjpegCamera) -> Iterator[ViserPage]:
    with ExitStack() as stack:
        cameras = f"--camera=table={camera.url}", "--camera=away=http://127.0.0.1:9/"
        server = stack.enter_context(AppServer((*APP, *cameras)))
        window = windows.open(server.url, window=PORTRAIT, drawing=Drawing.NONE)
        shown = stack.enter_context(window)
        shown.page.set_default_timeout(SECONDS)
        yield shown


def test_pictures_move_become_grey_when_they_are_old_and_come_back(
    page: ViserPage, camera: MjpegCamera
) -> None:
    document = page.page
    document.wait_for_selector("#cameras [data-old=false] canvas:visible")
    age = document.inner_text("#cameras summary span >> nth=0")
    assert age.endswith(" ms")
    places = set()
    for _ in range(10):
        document.wait_for_timeout(50)
        places.add(document.evaluate(RED_OF_BAR))
    assert len(places) > 3
    document.wait_for_function(
        "() => document.querySelector('#cameras').innerText.includes('Connection refused')"
    )
    assert findings(document) == []
    camera.fps = 0.0
    document.wait_for_selector("#cameras details:first-child[data-old=true] canvas:visible")
    assert "Do not drive by it." in document.inner_text("#cameras")
    # STOP is as always.
    document.click("#stop")
    document.wait_for_selector("#clear-stop:visible")
    camera.fps = 30.0
    document.wait_for_selector("#cameras details:first-child[data-old=false]")
    # Folded, it asks for no more pictures.
    document.click("#cameras summary >> nth=0")
    document.wait_for_function("() => !document.querySelector('#cameras summary span').innerText")
