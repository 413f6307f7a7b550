"""Pictures that MuJoCo draws of the exported model, compared with ours."""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.initial_camera import FIELD_OF_VIEW, camera
from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.resources import URDF_PATH
from tests.exchange.conftest import POSES
from tests.exchange.silhouette import SIZE, overlap, placed, silhouette
from tests.exchange.tools import needs, run

DRAW = """
import ctypes, json, sys
import mujoco
import numpy as np

path, file = sys.argv[1:3]
view, poses = map(json.loads, sys.argv[3:5])

# A context of OpenGL without a screen (Mesa), because MuJoCo's own needs another package.
SURFACELESS, OPENGL, END = 0x31DD, 0x30A2, 0x3038
SURFACE_TYPE, PBUFFER, RENDERABLE_TYPE, OPENGL_BIT, DEPTH_SIZE = 0x3033, 1, 0x3040, 8, 0x3025
egl = ctypes.CDLL("libEGL.so.1")
egl.eglGetPlatformDisplay.restype = egl.eglCreateContext.restype = ctypes.c_void_p
display = ctypes.c_void_p(egl.eglGetPlatformDisplay(SURFACELESS, None, None))
assert egl.eglInitialize(display, None, None)
assert egl.eglBindAPI(OPENGL)
words = (SURFACE_TYPE, PBUFFER, RENDERABLE_TYPE, OPENGL_BIT, DEPTH_SIZE, 24, END)
wanted = (ctypes.c_int * len(words))(*words)
config, count = ctypes.c_void_p(), ctypes.c_int()
assert egl.eglChooseConfig(display, wanted, ctypes.byref(config), 1, ctypes.byref(count))
context = ctypes.c_void_p(egl.eglCreateContext(display, config, None, None))
assert egl.eglMakeCurrent(display, None, None, context)

model = mujoco.MjModel.from_xml_path(path)
data = mujoco.MjData(model)
size = view["size"]
model.vis.global_.fovy = np.degrees(view["angle"])
model.vis.global_.offwidth = model.vis.global_.offheight = size
camera = mujoco.MjvCamera()
camera.lookat[:] = view["target"]
ahead = np.subtract(view["target"], view["eye"])
camera.distance = np.linalg.norm(ahead)
camera.azimuth = np.degrees(np.arctan2(ahead[1], ahead[0]))
camera.elevation = np.degrees(np.arcsin(ahead[2] / camera.distance))
option = mujoco.MjvOption()
option.geomgroup[:] = 0
option.geomgroup[2] = 1
option.sitegroup[:] = 0
scene = mujoco.MjvScene(model, 1000)
scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = 1
drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
area = mujoco.MjrRect(0, 0, size, size)
seen = []
for values in poses:
    for name, value in values.items():
        data.joint(name).qpos[0] = value
    mujoco.mj_forward(model, data)
    every = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, option, None, camera, every, scene)
    mujoco.mjr_render(area, scene, drawing)
    pixels = np.empty((size, size, 3), np.uint8)
    mujoco.mjr_readPixels(pixels, None, area, drawing)
    seen.append(np.flipud(pixels).any(axis=2))
np.save(file, np.array(seen))
"""


@needs("/usr/share/doc/libegl1", "/usr/share/doc/libgl1-mesa-dri")
@pytest.mark.long
def test_mujoco_draws_the_reference_pictures(tmp_path: Path, katana: Robot) -> None:
    assert main(["export", "mjcf", "--out", str(tmp_path)]) == 0
    zipfile.ZipFile(tmp_path / "katana450_mjcf.zip").extractall(tmp_path)
    view = camera(katana)
    seen_from = {
        "size": SIZE,
        "eye": view.eye.tolist(),
        "target": view.target.tolist(),
        "angle": FIELD_OF_VIEW,
    }
    poses = [katana.values(pose) for pose in POSES]
    model = tmp_path / "katana450" / "katana450.xml"
    words = (model, "seen.npy", json.dumps(seen_from), json.dumps(poses))
    run(sys.executable, "-c", DRAW, *words, folder=tmp_path)
    for theirs, values in zip(np.load(tmp_path / "seen.npy"), poses, strict=True):
        assert overlap(theirs, silhouette(placed(URDF_PATH, values), view)) >= 0.98
