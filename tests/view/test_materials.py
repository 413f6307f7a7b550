"""Materials of the robot in the scene."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import viser

from katana450.arm.robot.loader import load
from katana450.server.view.scene import ArmNodes
from katana450.srgb import to_light
from tests.viser_bridge import internals

# trimesh has no types for materials.
library: Any = trimesh

URDF = """<robot name="colours">
  <link name="base"><visual><geometry><mesh filename="two.dae" scale="2 2 -2"/></geometry></visual>
    <visual><geometry><box size="1 1 1"/></geometry>
      <material name="red"><color rgba="1 0.5 0 1"/></material></visual></link>
  <link name="tip"><visual><geometry><mesh filename="ball.stl"/></geometry></visual></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="tip"/></joint>
</robot>"""


def painted(mesh: Any, colour: tuple[int, int, int, int]) -> Any:
    material = library.visual.material.PBRMaterial(name=str(colour), baseColorFactor=colour)
    mesh.visual = library.visual.TextureVisuals(material=material)
    return mesh


def test_materials_and_normals_of_each_shape_are_drawn(
    server: viser.ViserServer, tmp_path: Path
) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    (tmp_path / "ball.stl").write_bytes(ball.export(file_type="stl"))
    parts = [painted(ball.copy(), (250, 10, 10, 255)), painted(ball.copy(), (10, 10, 250, 255))]
    parts[1].apply_translation((5.0, 0.0, 0.0))
    (tmp_path / "two.dae").write_bytes(library.exchange.dae.export_collada(parts))
    (tmp_path / "arm.urdf").write_text(URDF)
    robot = load(tmp_path / "arm.urdf")

    path = ArmNodes(server, robot).path
    for link in robot.links:
        drawn = [
            mesh
            for number in range(len(link.visuals))
            for mesh in _meshes(server, f"{path[link.name]}/shape{number}")
        ]
        assert len(drawn) == len(link.shapes)
        for mesh, shape in zip(drawn, link.shapes, strict=True):
            factor = mesh.visual.material.baseColorFactor[:3] / 255.0
            np.testing.assert_allclose(factor, to_light(shape.material.colour), atol=0.5 / 255.0)
            np.testing.assert_allclose(mesh.vertices, shape.vertices, atol=1e-6)
            np.testing.assert_allclose(mesh.vertex_normals, shape.normals, atol=1e-6)
            np.testing.assert_array_equal(mesh.faces, shape.faces)
    (sphere,) = robot.links[1].shapes
    # Neighbouring triangles share their corners and with them their normals.
    assert len(sphere.vertices) == len(ball.vertices)


def _meshes(server: viser.ViserServer, path: str) -> list[Any]:
    node: Any = internals.nodes(server)[path]
    scene = trimesh.load_scene(io.BytesIO(node.glb_data), file_type="glb", process=False)
    return list(scene.geometry.values())
