"""Tests of the GLB export: other programs find its names, places, colours and motion."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
import yourdfpy

from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.export.glb import glb_files
from katana450.extensions.export.playback import load_motion
from katana450.maths.geometry import so3
from katana450.resources import URDF_PATH
from tests.exchange.conftest import GANTRY, GANTRY_POSE, POSES
from tests.exchange.tools import GLTF_VALIDATOR, needs, needs_package, run

UPRIGHT = so3.rotation_x(-np.pi / 2.0)


@pytest.mark.parametrize("which", ["katana", "gantry"])
def test_trimesh_finds_every_link_at_its_place_in_the_urdf(
    which: str, katana: Robot, gantry: Robot
) -> None:
    path, robot, pose = (
        (URDF_PATH, katana, POSES[2]) if which == "katana" else (GANTRY, gantry, GANTRY_POSE)
    )
    values = robot.values(pose)
    ((name, content),) = glb_files(robot, values).items()
    assert name == ("katana450.glb" if which == "katana" else "gantry_2.glb")
    scene = trimesh.load_scene(io.BytesIO(content), file_type="glb")
    urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    urdf.update_cfg({name: values[name] for name in urdf.actuated_joint_names})
    for link in robot.links:
        T, _ = scene.graph[link.name]
        expected = urdf.get_transform(link.name)
        np.testing.assert_allclose(T[:3, 3], UPRIGHT @ expected[:3, 3], atol=1e-6)
        np.testing.assert_allclose(T[:3, :3], UPRIGHT @ expected[:3, :3], atol=1e-6)
        if link.parent is not None:
            assert scene.graph.transforms.parents[link.name] == link.parent
    shapes = [shape for link in robot.links for shape in link.shapes]
    assert sum(len(mesh.faces) for mesh in scene.geometry.values()) == sum(
        len(shape.faces) for shape in shapes
    )
    found = {mesh.visual.material.name for mesh in scene.geometry.values()}
    assert found == {shape.material.name for shape in shapes}


def test_colours_and_normals_are_preserved(katana: Robot) -> None:
    """Compare with the mesh files that the URDF names."""
    ((_, content),) = glb_files(katana, katana.values(())).items()
    ours = trimesh.load_scene(io.BytesIO(content), file_type="glb")
    theirs = trimesh.load_scene(URDF_PATH.parent / "meshes" / "wrist_link.glb")
    in_wrist = [ours.geometry[ours.graph[n][1]] for n in ours.graph.nodes_geometry if "wrist" in n]
    by_name = {mesh.visual.material.name: mesh for mesh in in_wrist}
    assert len(by_name) == len(theirs.geometry) == 6
    for mesh in theirs.geometry.values():
        own = by_name[mesh.visual.material.name]
        a, b = (np.array(m.visual.material.baseColorFactor, dtype=int) for m in (mesh, own))
        assert np.abs(a - b).max() <= 1
        np.testing.assert_allclose(own.vertex_normals, mesh.vertex_normals, atol=1e-5)
        np.testing.assert_allclose(own.vertices, mesh.vertices, atol=1e-7)


def chunks(content: bytes) -> tuple[dict[str, Any], bytes]:
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON"
    gltf = json.loads(content[20 : 20 + size])
    binary, kind = struct.unpack_from("<I4s", content, 20 + size)
    assert kind == b"BIN\0"
    body = content[28 + size :]
    assert len(body) == binary == gltf["buffers"][0]["byteLength"]
    return gltf, body


def floats(gltf: dict[str, Any], body: bytes, number: int) -> npt.NDArray[np.float32]:
    accessor = gltf["accessors"][number]
    view = gltf["bufferViews"][accessor["bufferView"]]
    values = np.frombuffer(body, "<f4", view["byteLength"] // 4, view["byteOffset"])
    return values.reshape(accessor["count"], -1)


def test_the_motion_is_that_of_the_file(tmp_path: Path, gantry: Robot) -> None:
    (tmp_path / "m.csv").write_text("t,rail,turn,grip\n0,0,0,0\n1,0.4,5,-1\n3,-0.4,4,0.5\n")
    motion = load_motion(tmp_path / "m.csv", gantry)
    ((_, content),) = glb_files(gantry, gantry.values(()), motion).items()
    gltf, body = chunks(content)
    (animation,) = gltf["animations"]
    assert len(animation["channels"]) == len(gantry.joints)
    urdf = yourdfpy.URDF.load(str(GANTRY), load_meshes=False, build_scene_graph=True)
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        node = gltf["nodes"][channel["target"]["node"]]
        t, rows = (floats(gltf, body, sampler[side]) for side in ("input", "output"))
        joint = next(j for j in urdf.robot.joints if j.child == node["name"])
        for when, row in zip(t[:, 0], rows, strict=True):
            now = {
                name: float(np.interp(when, motion.t, motion.values[name]))
                for name in gantry.driven
            }
            urdf.update_cfg(now)
            T = urdf.get_transform(node["name"], joint.parent)
            if channel["target"]["path"] == "translation":
                np.testing.assert_allclose(row, T[:3, 3], atol=1e-6)
            else:
                R = so3.from_quaternion(np.roll(row.astype(float), 1))
                np.testing.assert_allclose(R, T[:3, :3], atol=2e-6)
    extras = {n["name"]: n["extras"]["joint"] for n in gltf["nodes"] if "extras" in n}
    assert extras["cart"] == {
        "name": "rail",
        "type": "prismatic",
        "axis": [1.0, 0.0, 0.0],
        "lower": -0.4,
        "upper": 0.4,
    }
    assert "lower" not in extras["mast"]
    assert extras["thumb"]["mimic"] == {"joint": "grip", "multiplier": -0.1, "offset": -0.04}


VALIDATE = """
const [folder, file] = process.argv.slice(1);
const bytes = new Uint8Array(require("fs").readFileSync(file));
require(folder).validateBytes(bytes).then(found => console.log(JSON.stringify(found.issues)));
"""


@pytest.mark.long
@needs_package(GLTF_VALIDATOR)
@needs("node")
@pytest.mark.parametrize("urdf", [URDF_PATH, GANTRY])
def test_validator_of_gltf_finds_nothing(tmp_path: Path, urdf: Path) -> None:
    """Links without a shape are empty nodes, which it mentions."""
    (tmp_path / "m.csv").write_text("t,theta1\n0,0\n2,0.3\n")
    motion = ["--trajectory", str(tmp_path / "m.csv")]
    assert main(["export", "glb", "--urdf", str(urdf), "--out", str(tmp_path), *motion]) == 0
    (path,) = tmp_path.glob("*.glb")
    script = GLTF_VALIDATOR.file
    assert script is not None
    issues = json.loads(run("node", "-e", VALIDATE, script.parent, path))
    assert {each["code"] for each in issues["messages"]} <= {"NODE_EMPTY"}
    assert issues["numErrors"] == issues["numWarnings"] == 0
