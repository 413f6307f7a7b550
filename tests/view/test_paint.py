"""Paint of the arm and of objects: what a state colours."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.appearance import Appearance, AppearanceTrait
from katana450.arm.control.state.state import State
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.resources import URDF_PATH
from katana450.server.view.paint import PaintNodes
from katana450.server.view.scene import ArmNodes
from katana450.srgb import to_light
from tests.viser_bridge import internals
from tests.viser_bridge.internals import nodes


class Shown:
    """A scene of arm and paint."""

    def __init__(self, server: viser.ViserServer, robot: Robot, session: Session) -> None:
        self.server = server
        self.arm = ArmNodes(server, robot)
        self.paint = PaintNodes(server, self.arm)
        self.state = session.begin(session.ready, 0.0, 0.0)
        self.show()

    def show(self, **changes: object) -> State:
        self.state = replace(self.state, **changes)  # type: ignore[arg-type]
        self.paint.follow(self.state)
        return self.state

    def painted(self) -> dict[str, tuple[int, int, int]]:
        return {
            name: node.color
            for name, node in nodes(self.server).items()
            if isinstance(node, viser.MeshHandle) and "paint" in name and node.visible
        }


@pytest.fixture
def shown(server: viser.ViserServer, robot: Robot, session: Session) -> Shown:
    return Shown(server, robot, session)


def test_link_is_painted_hidden_and_restored(shown: Shown) -> None:
    visible = [shape.visible for shape in shown.arm.shapes["pan_link"]]
    assert visible
    assert all(visible)
    red = Appearance().having("pan_link", AppearanceTrait.COLOUR, (1.0, 0.0, 0.2))
    shown.show(appearance=red)
    painted = shown.painted()
    assert set(painted.values()) == {(255, 0, 51)}
    assert all("/pan_link/paint" in name for name in painted)
    assert not any(shape.visible for shape in shown.arm.shapes["pan_link"])
    glass = Appearance().having("pan_link", AppearanceTrait.TRANSPARENCY, 0.75)
    shown.show(appearance=glass)
    # Without a colour of its own, the paint has the link's main colour.
    robot = load(URDF_PATH)
    (link,) = (link for link in robot.links if link.name == "pan_link")
    assert set(shown.painted().values()) == {tuple(round(255.0 * part) for part in link.colour)}
    node = nodes(shown.server)["/".join((shown.arm.path["pan_link"], "paint0"))]
    assert isinstance(node, viser.MeshHandle)
    assert node.opacity == 0.25
    shown.show(appearance=Appearance().having("pan_link", AppearanceTrait.CHOICE, -1))
    assert shown.painted() == {}
    assert not any(shape.visible for shape in shown.arm.shapes["pan_link"])
    shown.show(appearance=Appearance())
    assert [shape.visible for shape in shown.arm.shapes["pan_link"]] == visible
    assert shown.painted() == {}


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
