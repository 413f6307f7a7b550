"""Tests of the C export: compiles without warnings, draws correctly, follows a server."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.initial_camera import camera
from katana450.arm.robot.robot import Robot
from katana450.extensions.export.c_source import c_files
from katana450.maths.geometry import so3
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.browser.server import APP, AppServer
from tests.exchange.conftest import GANTRY, GANTRY_POSE, POSES
from tests.exchange.silhouette import SIZE, overlap, placed, seen, silhouette
from tests.exchange.tools import SCREEN, VIEWER, needs, run

pytestmark = pytest.mark.long


def written(folder: Path, robot: Robot, pose: tuple[float, ...]) -> Path:
    folder.mkdir(exist_ok=True)
    for name, content in c_files(robot, robot.values(pose)).items():
        (folder / name).write_bytes(content)
    return folder


@pytest.fixture(scope="module")
def viewer(tmp_path_factory: pytest.TempPathFactory, katana: Robot) -> Path:
    """Return the Katana's viewer, built by gcc."""
    folder = written(tmp_path_factory.mktemp("c"), katana, POSES[1])
    run("make", "viewer", "CC=gcc", "CFLAGS=-O2 -Werror", folder=folder, seconds=120.0)
    return folder / "viewer"


def shot(viewer: Path, picture: Path, *words: str) -> Path:
    size = f"{SIZE}x{SIZE}"
    run(*SCREEN, viewer, "--size", size, *words, "--screenshot", picture)
    return picture


def joined(pose: tuple[float, ...]) -> str:
    return ",".join(map(str, pose))


@needs(*VIEWER)
@pytest.mark.parametrize("pose", POSES)
def test_the_viewer_draws_the_reference_picture(
    tmp_path: Path, viewer: Path, katana: Robot, pose: tuple[float, ...]
) -> None:
    ours = silhouette(placed(URDF_PATH, katana.values(pose)), camera(katana))
    theirs = seen(shot(viewer, tmp_path / "a.ppm", "--pose", joined(pose)))
    assert overlap(theirs, ours) >= 0.98


@needs(*VIEWER, "clang", "cmake")
def test_clang_and_cmake_build_any_mechanism(tmp_path: Path, gantry: Robot) -> None:
    folder = written(tmp_path / "c", gantry, GANTRY_POSE)
    words = ("-DCMAKE_C_COMPILER=clang", "-DCMAKE_C_FLAGS=-Werror")
    run("cmake", "-S", folder, "-B", tmp_path / "build", *words)
    run("cmake", "--build", tmp_path / "build")
    ours = silhouette(placed(GANTRY, gantry.values(GANTRY_POSE)), camera(gantry))
    # The start values are in the files.
    theirs = seen(shot(tmp_path / "build" / "viewer", tmp_path / "a.ppm"))
    assert overlap(theirs, ours) >= 0.98


@needs(*VIEWER, "cmake")
def test_linux_preset_builds_the_kinematics_and_the_viewer(tmp_path: Path, gantry: Robot) -> None:
    folder = written(tmp_path / "c", gantry, GANTRY_POSE)
    presets = json.loads((folder / "CMakePresets.json").read_text())["configurePresets"]
    windows = [preset for preset in presets if preset["generator"].startswith("Visual Studio")]
    assert all(preset["condition"]["rhs"] == "Windows" for preset in windows)
    assert len(windows) == 2
    # Those of Windows are read too, and not offered.
    listed = run("cmake", "--list-presets", folder=folder)
    assert "linux" in listed
    assert "visual-studio" not in listed
    run("cmake", "--preset", "linux", folder=folder)
    run("cmake", "--build", "--preset", "linux", folder=folder)
    assert (folder / "build" / "linux" / "viewer").is_file()
    assert (folder / "build" / "linux" / "libkinematics.a").is_file()


@needs("gcc", "make", "cmake")
def test_kinematics_build_without_opengl(tmp_path: Path, katana: Robot) -> None:
    folder = written(tmp_path / "c", katana, ())
    run("cmake", "-S", folder, "-B", tmp_path / "build", "-DVIEWER=OFF")
    run("cmake", "--build", tmp_path / "build")
    assert (tmp_path / "build" / "libkinematics.a").is_file()
    assert not (tmp_path / "build" / "viewer").exists()


@needs(*VIEWER)
def test_it_follows_a_running_server(tmp_path: Path, viewer: Path, katana: Robot) -> None:
    with AppServer((*APP, "--lines", "0")) as server:
        deadline = time.monotonic() + 20.0
        while not (match := re.search(r"JSON lines on 127\.0\.0\.1:(\d+)", server.output)):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        theirs = seen(shot(viewer, tmp_path / "a.ppm", "--follow", match[1]))
    ours = silhouette(placed(URDF_PATH, katana.values(Settings.ready)), camera(katana))
    assert overlap(theirs, ours) >= 0.98


HANDS = """
"$0" --size "$1" & viewer=$!
xdotool search --sync --name katana450 > window
picture() {
    xdotool key p
    until [ -s viewer.ppm ]; do kill -0 $viewer || exit 1; sleep 0.05; done
    sleep 0.2
    mv viewer.ppm "$1"
}
xdotool mousemove 400 400 key 2 key minus key minus key Left key Left key plus
xdotool key 1 keydown shift mousedown 1 mousemove 420 400 mouseup 1 keyup shift
sleep 0.2
picture joints.ppm
xdotool mousemove 400 400 mousedown 1 mousemove 450 400 mouseup 1
sleep 0.2
picture view.ppm
xdotool key Escape
wait $viewer
"""


@needs(*VIEWER, "xdotool")
def test_keys_and_mouse_move_joints_and_camera(tmp_path: Path, viewer: Path, katana: Robot) -> None:
    run(*SCREEN, "bash", "-c", HANDS, viewer, f"{SIZE}x{SIZE}", folder=tmp_path)
    pose = np.add(POSES[1], (0.2, -0.15, 0.0, 0.0, 0.0, 0.0))
    meshes, view = placed(URDF_PATH, katana.values(pose.tolist())), camera(katana)
    assert overlap(seen(tmp_path / "joints.ppm"), silhouette(meshes, view)) >= 0.98
    turned = view._replace(eye=view.target + so3.rotation_z(-0.5) @ (view.eye - view.target))
    assert overlap(seen(tmp_path / "view.ppm"), silhouette(meshes, turned)) >= 0.98


@needs("gcc", "make", "/usr/include/GL/freeglut.h")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--pose", "1,x"), "comma-separated numbers"),
        (("--pose", "9"), "outside the limits"),
        (("--pose", "nan"), "outside the limits"),
        (("--pose", "0,0,0,0,0,0,0"), "more numbers than"),
        (("--size", "0x10"), "WIDTHxHEIGHT"),
        (("--follow", "70000"), "a port"),
        (("--fly", "1"), "--fly"),
        (("--pose",), "--pose"),
    ],
)
def test_unknown_options_are_refused_without_a_screen(
    viewer: Path, words: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(AssertionError, match=f"ended with 2:.*(?s:.*){said}"):
        run(viewer, *words)


def test_the_arrays_are_the_papers(katana: Robot) -> None:
    """The three arrays of each link have the same data as its shapes."""
    files = c_files(katana, katana.values(()))
    total = 0
    for link in katana.links:
        if not link.shapes:
            continue
        source = files[f"{link.name}.c"].decode()
        vertices, normals, faces = (
            np.array(re.findall(r"-?[0-9][0-9.e-]*", re.sub("f,|f}", " ", body)), dtype=float)
            for body in re.findall(
                r"_(?:vertices|normals|face_indices).*? = \{(.*?)\n\};", source, re.S
            )
        )
        rows = faces.reshape(-1, 9).astype(int)
        total += len(rows)
        corners = vertices.reshape(-1, 3)[rows[:, :3]]
        upright = normals.reshape(-1, 3)[rows[:, 3:6]]
        expected = np.concatenate([shape.vertices[shape.faces] for shape in link.shapes])
        np.testing.assert_allclose(corners, expected, atol=0.51e-5)
        expected = np.concatenate([shape.normals[shape.faces] for shape in link.shapes])
        np.testing.assert_allclose(upright, expected, atol=0.51e-3)
        assert not rows[:, 6:].any()
        assert (
            f"#define {link.name.upper()}_FACES {len(rows)}\n" in files[f"{link.name}.h"].decode()
        )
    assert total == 48_942


def test_names_of_a_robot_cannot_break_the_c(gantry: Robot) -> None:
    files = c_files(gantry, gantry.values(()))
    assert {"left_finger.c", "right_finger.c"} <= set(files)
    assert b'#define ROBOT_NAME "gantry 2"' in files["robot.h"]
    assert b'{"turn", 0, -HUGE_VAL, HUGE_VAL}' in files["robot.c"]
