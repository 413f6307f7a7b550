"""Our VRML97 files in X_ITE, a VRML browser in a web page, give the same silhouettes."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Browser, Route

from katana450.arm.robot.initial_camera import camera
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.extensions.export.vrml import vrml_files
from katana450.resources import URDF_PATH
from tests.exchange.conftest import POSES
from tests.exchange.silhouette import SIZE, overlap, placed, seen, silhouette
from tests.exchange.tools import X_ITE, x_ite

pytestmark = pytest.mark.long

SCRIPT = x_ite()

HOST = "http://exports.test"

PAGE = f"""<!doctype html><title>X_ITE</title><body style="margin: 0">
<script src="x_ite.min.js"></script>
<x3d-canvas splashScreen="false" notifications="false"
  style="display: block; width: {SIZE}px; height: {SIZE}px"></x3d-canvas>"""

LOAD = """url => document.querySelector("x3d-canvas").browser.loadURL(new X3D.MFString(url))"""

TURN = """async turns => {
  const browser = document.querySelector("x3d-canvas").browser;
  for (const [name, turn] of Object.entries(turns))
    browser.currentScene.getNamedNode(name).rotation = new X3D.SFRotation(...turn);
  await browser.nextFrame();
  await browser.nextFrame();
}"""


@pytest.mark.skipif(SCRIPT is None, reason=f"{X_ITE} is not here; `make exchange` brings it")
def test_x_ite_draws_what_we_do(browser: Browser, tmp_path: Path) -> None:
    """Open the file at the first pose, then turn its joints to the others."""
    assert SCRIPT is not None
    script, katana = SCRIPT, load(URDF_PATH)
    page = browser.new_page(viewport={"width": SIZE, "height": SIZE})
    world = vrml_files(katana, katana.values(POSES[0]))["katana450.wrl"]

    def answer(route: Route) -> None:
        name = route.request.url.removeprefix(f"{HOST}/")
        own = script.parent / name
        if name == "":
            route.fulfill(body=PAGE, content_type="text/html")
        elif name == "katana450.wrl":
            route.fulfill(body=world, content_type="model/vrml")
        elif own.is_file():
            route.fulfill(path=own)
        else:
            route.fulfill(status=404)

    try:
        page.route(f"{HOST}/**", answer)
        page.goto(f"{HOST}/")
        page.evaluate(LOAD, f"{HOST}/katana450.wrl")
        for pose in POSES:
            page.evaluate(TURN, turns(katana, pose))
            picture = tmp_path / "picture.png"
            page.screenshot(path=picture)
            ours = silhouette(placed(URDF_PATH, katana.values(pose)), camera(katana))
            assert overlap(seen(picture), ours) >= 0.98
    finally:
        page.close()


def turns(katana: Robot, pose: tuple[float, ...]) -> dict[str, list[float]]:
    """Return axis and angle of each joint; at zero all frames of the Katana are parallel."""
    values = katana.values(pose)
    return {name: [*joint.axis.tolist(), values[name]] for name, joint in katana.joints.items()}
