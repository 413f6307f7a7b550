"""Our VRML97 files in X_ITE, a VRML browser in a web page, give the same silhouettes."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Browser, Route

from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.extensions.export.vrml.vrml_files import view, vrml_files, world_of
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
    """Open the file of each pose, turn its joints to another one and back."""
    assert SCRIPT is not None
    script, katana = SCRIPT, load(URDF_PATH)
    page = browser.new_page(viewport={"width": SIZE, "height": SIZE})
    worlds = [
        vrml_files(katana, world_of(katana, katana.values(pose)))["katana450.wrl"] for pose in POSES
    ]

    def answer(route: Route) -> None:
        name = route.request.url.removeprefix(f"{HOST}/")
        own = script.parent / name
        if name == "":
            route.fulfill(body=PAGE, content_type="text/html")
        elif name.endswith(".wrl"):
            route.fulfill(body=worlds[int(name[0])], content_type="model/vrml")
        elif own.is_file():
            route.fulfill(path=own)
        else:
            route.fulfill(status=404)

    try:
        page.route(f"{HOST}/**", answer)
        page.goto(f"{HOST}/")
        for number, pose in enumerate(POSES):
            page.evaluate(LOAD, f"{HOST}/{number}.wrl")
            for turned in (POSES[number - 1], pose):
                page.evaluate(TURN, turns(katana, turned))
            picture = tmp_path / "picture.png"
            page.screenshot(path=picture)
            values = katana.values(pose)
            ours = silhouette(placed(URDF_PATH, values), view(katana, values))
            assert overlap(seen(picture), ours) >= 0.98
    finally:
        page.close()


def turns(katana: Robot, pose: tuple[float, ...]) -> dict[str, list[float]]:
    """Return axis and angle of each joint; at zero all frames of the Katana are parallel."""
    values = katana.values(pose)
    return {name: [*joint.axis.tolist(), values[name]] for name, joint in katana.joints.items()}
