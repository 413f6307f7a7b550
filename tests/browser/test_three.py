"""Our files in three.js, as shipped by the command, give the same silhouettes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Route

from katana450.arm.robot.loader import load
from katana450.cli.main import main
from katana450.extensions.export.vrml import views
from katana450.resources import URDF_PATH
from tests.exchange.conftest import POSES
from tests.exchange.silhouette import SIZE, overlap, placed, seen, silhouette
from tests.exchange.tools import THREE, needs_package

pytestmark = [pytest.mark.long, needs_package(THREE)]

HOST = "http://exports.test"

PAGE = """<!doctype html><title>three.js</title><body style="margin: 0">
<script type="importmap">{"imports": {
  "three": "/build/three.module.js", "three/addons/": "/examples/jsm/"}}</script>"""

DRAW = """async ([path, eye, target, up]) => {
  const THREE = await import("three");
  const {VRMLLoader} = await import("three/addons/loaders/VRMLLoader.js");
  const {GLTFLoader} = await import("three/addons/loaders/GLTFLoader.js");
  const loaded = await new (path.endsWith(".glb") ? GLTFLoader : VRMLLoader)().loadAsync(path);
  const root = loaded.scene ?? loaded;
  // The background of a world is a sphere around it.
  root.traverse(node => { if (node.material?.side === THREE.BackSide) node.visible = false; });
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0x00ff00);
  scene.add(root, new THREE.AmbientLight(0xffffff, 1));
  const camera = new THREE.PerspectiveCamera(40, 1, 0.01, 20);
  camera.position.set(...eye);
  camera.up.set(...up);
  camera.lookAt(...target);
  const renderer = new THREE.WebGLRenderer({preserveDrawingBuffer: true});
  renderer.setSize(innerWidth, innerHeight);
  document.body.replaceChildren(renderer.domElement);
  renderer.render(scene, camera);
}"""


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("name", ["katana450.wrl", "katana450.glb"])
def test_three_draws_what_we_do(
    name: str, pose: tuple[float, ...], browser: Browser, tmp_path: Path
) -> None:
    script = THREE.file
    assert script is not None
    options = ["glb"] if name.endswith(".glb") else ["vrml", "--plain", "--no-objects"]
    values = ",".join(map(str, pose))
    assert main(["export", *options, "--out", str(tmp_path), f"--pose={values}"]) == 0

    def answer(route: Route) -> None:
        path = route.request.url.removeprefix(f"{HOST}/")
        own = script.parents[1] / path
        if path == "":
            route.fulfill(body=PAGE, content_type="text/html")
        elif path == name:
            route.fulfill(path=tmp_path / name)
        elif own.is_file():
            route.fulfill(path=own, content_type="text/javascript")
        else:
            route.fulfill(status=404)

    katana = load(URDF_PATH)
    view = views(katana, katana.values(pose))["All"]
    page = browser.new_page(viewport={"width": SIZE, "height": SIZE})
    try:
        page.route(f"{HOST}/**", answer)
        page.goto(f"{HOST}/")
        # three.js has y up.
        eye, target = ([x, z, -y] for x, y, z in np.array([view.eye, view.target]).tolist())
        page.evaluate(DRAW, [f"/{name}", eye, target, [0, 1, 0]])
        picture = tmp_path / "picture.png"
        page.screenshot(path=picture)
    finally:
        page.close()
    ours = silhouette(placed(URDF_PATH, katana.values(pose)), view)
    assert overlap(seen(picture), ours) >= 0.98
