"""Cameras beside the scene: pictures with their age, grey when they are old. Without viser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.browser.camera import Drawing
from tests.browser.conftest import Windows
from tests.browser.page import ViserPage
from tests.browser.server import APP, RECORDING_APP, AppServer
from tests.browser.sizes import PORTRAIT, WIDE
from tests.browser.test_accessibility import findings
from tests.browser.test_timeline import place
from tests.cameras.mjpeg_camera import MjpegCamera
from tests.recording.test_episodes_on_a_server import move
from tests.recording.test_recorder import POSTURES

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
        sources = f"table={camera.url}", "away=http://127.0.0.1:9/", "mine=browser"
        cameras = [f"--camera={source}" for source in sources]
        server = stack.enter_context(AppServer((*APP, *cameras)))
        window = windows.open(server.url, window=PORTRAIT, drawing=Drawing.NONE)
        shown = stack.enter_context(window)
        shown.page.set_default_timeout(SECONDS)
        yield shown


def test_pictures_move_become_grey_when_they_are_old_and_come_back(
    page: ViserPage, camera: MjpegCamera
) -> None:
    document = page.page
    # Folded at first on a phone.
    for camera_name in ("table", "away"):
        document.click(f"#cameras summary:has-text('{camera_name}')")
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
    # A camera of the browser's machine is shown to everybody while the person shares it.
    document.click("#cameras summary:has-text('mine')")
    document.wait_for_selector("#cameras :text('Nobody shares this camera yet.')")
    document.context.grant_permissions(["camera"])
    document.click("text=Share a camera of this device")
    document.wait_for_selector("#cameras details:last-child[data-old=false] canvas:visible")
    assert document.evaluate("document.querySelector('details:last-child canvas').width") == 640
    document.click("text=Stop sharing")
    document.wait_for_selector("#cameras details:last-child[data-old=true] canvas:visible")


@pytest.mark.long
def test_past_shows_recorded_pictures(
    windows: Windows, camera: MjpegCamera, tmp_path: Path
) -> None:
    options = f"--camera=table={camera.url}", f"--record={tmp_path / 'ring'}", "--silence=2.0"
    with AppServer((*RECORDING_APP, *options)) as server:
        move(server, *POSTURES, *POSTURES, *POSTURES)
        with windows.open(server.url, window=WIDE) as shown:
            document = shown.page
            document.wait_for_function("() => document.querySelector('#timeline .now')?.max > 2")
            # The process that records begins a few seconds after the arm.
            place(shown, document.evaluate("document.querySelector('#timeline .now').max - 0.5"))
            document.wait_for_function(
                f"() => ({RED_OF_BAR})() !== null && document.body.innerText.includes('Recorded')"
            )
            column = document.evaluate(RED_OF_BAR)
            document.wait_for_timeout(300)
            assert document.evaluate(RED_OF_BAR) == column
            document.get_by_text("Back to live").click()
            document.wait_for_selector("#cameras [data-old=false] canvas:visible")
            document.wait_for_function(f"column => ({RED_OF_BAR})() !== column", arg=column)
