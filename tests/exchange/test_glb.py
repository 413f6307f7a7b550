"""Tests of the GLB export: other programs find its names, places and colours."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yourdfpy

from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.export.glb import glb_files
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
    names = {mesh.visual.material.name for mesh in scene.geometry.values()}
    assert names == {shape.material.name for shape in shapes}


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
    assert main(["export", "glb", "--urdf", str(urdf), "--out", str(tmp_path)]) == 0
    (path,) = tmp_path.glob("*.glb")
    script = GLTF_VALIDATOR.file
    assert script is not None
    issues = json.loads(run("node", "-e", VALIDATE, script.parent, path))
    assert {issue["code"] for issue in issues["messages"]} <= {"NODE_EMPTY"}
    assert issues["numErrors"] == issues["numWarnings"] == 0
