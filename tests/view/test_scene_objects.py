"""Scene objects are drawn with their appearance, and coated while the arm is near."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
import viser
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import MIN_SIZE, SceneObject, Shape, Zone
from katana450.arm.control.state.solid import ObjectAppearance
from katana450.arm.control.state.state import State
from katana450.arm.robot.object_meshes import Mesh, Meshes
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import drawn, glb
from katana450.extensions.importers.formats.mesh_file import read_mesh
from katana450.extensions.objects.handles import HandlesLayer
from katana450.maths.geometry import se3, so3
from katana450.maths.water.environment import TableTop
from katana450.server.view.layer import LayerContext
from katana450.server.view.scene import COAT_THICKNESS, DETAIL, coarse, surface
from katana450.server.view.scene_objects import SceneObjectNodes
from tests.view.gestures import RecordedGestures
from tests.viser_bridge import internals

PATH = "/objects/it"


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    painted = trimesh.creation.box((60.0, 40.0, 20.0))
    painted.visual.face_colors = [[220, 30, 30, 255]] * 6 + [[30, 30, 220, 255]] * 6
    return read_mesh(painted.export(file_type="ply"), "it.ply")


def seen(state: State, *objects: SceneObject) -> State:
    return replace(state, objects=objects)


def test_mesh_is_drawn_again_only_when_necessary(
    server: viser.ViserServer, state: State, mesh: Mesh
) -> None:
    meshes = Meshes()
    meshes.put([mesh], ())
    nodes = SceneObjectNodes(server, load_props(), Environment(None, None), meshes)
    scene_object = SceneObject("it", Shape.MESH, (), np.eye(4), solid=mesh.solid)

    def node(name: str = "shape") -> viser.SceneNodeHandle:
        return internals.nodes(server)[f"{PATH}/{name}"]

    nodes.follow(seen(state, scene_object))
    own = node()
    assert isinstance(own, viser.GlbHandle)
    nodes.follow(seen(state, replace(scene_object, scale=2.0)))
    assert node() is own
    assert own.scale == 2.0
    nodes.follow(seen(state, replace(scene_object, appearance=ObjectAppearance((1, 2, 3), 0.5))))
    one = node()
    assert isinstance(one, viser.MeshHandle)
    assert (tuple(one.color), one.opacity, one.scale) == ((1, 2, 3), 0.5, 1.0)
    nodes.follow(seen(state, replace(scene_object, appearance=ObjectAppearance((4, 5, 6)))))
    assert node() is one
    assert (tuple(one.color), one.opacity) == ((4, 5, 6), None)

    def shown(path: str = PATH) -> bool:
        return bool(internals.nodes(server)[path].visible)

    nodes.follow(
        seen(state, replace(scene_object, appearance=ObjectAppearance((4, 5, 6), hidden=True)))
    )
    assert not shown()
    nodes.follow(
        seen(state, replace(scene_object, appearance=ObjectAppearance((4, 5, 6)), scale=1.5))
    )
    assert shown()
    assert one.scale == 1.5
    nodes.follow(seen(state))
    assert not [node for node in internals.nodes(server) if node.startswith(PATH)]


def test_mesh_without_triangles_is_drawn_as_its_convex_body(
    server: viser.ViserServer, state: State, mesh: Mesh
) -> None:
    nodes = SceneObjectNodes(server, load_props(), Environment(None, None), Meshes())
    scene_object = SceneObject("it", Shape.MESH, (), np.eye(4), solid=mesh.solid)
    nodes.follow(seen(state, scene_object))
    shape = internals.nodes(server)[f"{PATH}/shape"]
    assert isinstance(shape, viser.MeshHandle)
    np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), mesh.solid.size, atol=1e-6)
    # Its faces look outwards, or the volume would be another one.
    hull = trimesh.Trimesh(mesh.solid.corners).convex_hull
    body = trimesh.Trimesh(shape.vertices, shape.faces)
    assert body.volume == pytest.approx(hull.volume, rel=1e-4)
    nodes.follow(seen(state))


def test_faces_are_split_at_creases_and_colours_only(mesh: Mesh) -> None:
    ball = trimesh.creation.icosphere(3)
    assert len(drawn(ball.vertices, ball.faces).vertices) == len(ball.vertices)
    half = np.where(ball.triangles_center[:, 2] > 0.0, 0, 1)
    colours = np.array([[255, 0, 0, 255], [0, 0, 255, 255]], dtype=np.uint8)[half]
    split = drawn(ball.vertices, ball.faces, colours)
    assert split.colours is not None
    np.testing.assert_array_equal(split.colours[split.faces][:, 0], colours)
    np.testing.assert_allclose(split.vertices[split.faces], ball.triangles, atol=1e-12)
    assert len(ball.vertices) < len(split.vertices) < len(ball.vertices) + 100
    tube = trimesh.creation.cylinder(1.0, 2.0, sections=32)
    # The round side and each lid have vertices of their own.
    assert len(drawn(tube.vertices, tube.faces).vertices) == 4 * 32 + 2
    # Another program reads the same size.
    back = trimesh.load_scene(trimesh.util.wrap_as_stream(glb(mesh.drawn, 0.5)), file_type="glb")
    np.testing.assert_allclose(np.ptp(back.bounds, axis=0), mesh.solid.size, atol=1e-6)


def test_cup_dragged_beyond_the_table_waits_at_its_edge(
    server: viser.ViserServer, session: Session
) -> None:
    """The reason is shown at the release, and the handle returns to the cup."""
    gestures = RecordedGestures()
    put = gestures.commands
    around = Environment(None, None, TableTop((-0.25, 0.75), (-0.7, 0.7), -0.025))
    nodes = HandlesLayer()
    session_of_handles: Any = SimpleNamespace(environment=around)
    arm: Any = None
    nodes.attach(LayerContext(server, arm, session_of_handles, arm, gestures))
    cup = SceneObject("cup", Shape.CYLINDER, (0.032, 0.09), np.eye(4), can_be_held=True)
    nodes.follow(seen(session.begin(session.ready, 0.0, 0.0), cup))
    shown: list[str] = []
    client = SimpleNamespace(add_notification=lambda _title, text, **_: shown.append(text))

    def drag(phase: str, x: float) -> None:
        target = SimpleNamespace(position=(x, 0.1, 0.0))
        event: Any = SimpleNamespace(phase=phase, target=target, client=client, client_id=1)
        nodes._moved("cup", event)

    drag("start", 0.7)
    drag("update", 0.74)
    drag("update", 1.5)
    assert [
        command.scene_object.T[0, 3] for command in put if isinstance(command, cmd.PlaceObject)
    ] == [
        0.7,
        0.74,
    ]
    assert not shown
    nodes.follow(seen(session.begin(session.ready, 0.0, 0.0), put[-1].scene_object))  # type: ignore[attr-defined]
    drag("end", 1.5)
    assert len(put) == 2
    assert "nothing carries it there" in shown[0]
    assert tuple(nodes._handles["cup"].position) == (0.74, 0.1, 0.0)


def test_corner_of_a_box_changes_its_size_and_rings_turn_a_plane(
    server: viser.ViserServer, session: Session
) -> None:
    gestures, nodes = RecordedGestures(), HandlesLayer()
    arm: Any = None
    around: Any = SimpleNamespace(environment=Environment(None, None, None))
    nodes.attach(LayerContext(server, arm, around, arm, gestures))
    T = se3.from_rotation_translation(so3.rotation_z(np.pi / 2.0), (0.4, 0.1, 0.2))
    zone = SceneObject("zone", Shape.BOX, (0.2, 0.3, 0.1), T, scale=2.0, zone=Zone.KEEP_OUT)
    plane = SceneObject("wall", Shape.PLANE, (0.8, 0.6), T, zone=Zone.KEEP_OUT)
    nodes.follow(seen(session.begin(session.ready, 0.0, 0.0), zone, plane))
    corner = nodes._second["zone"]
    np.testing.assert_allclose(corner.position, (-0.3, 0.2, 0.2), atol=1e-9)
    np.testing.assert_allclose(nodes._handles["zone"].position, (0.4, 0.1, 0.2), atol=1e-9)

    def drag(act: Any, **target: Any) -> SceneObject:
        for phase in ("start", "end"):
            event: Any = SimpleNamespace(phase=phase, target=SimpleNamespace(**target), client_id=1)
            act(event)
        command = gestures.commands[-1]
        assert isinstance(command, cmd.PlaceObject)
        return command.scene_object

    # Its own x axis points along y: the corner moves by 0.1 m along x and by 0.05 m up.
    larger = drag(partial(nodes._resized, "zone"), position=np.array((-0.3, 0.3, 0.25)))
    np.testing.assert_allclose(larger.extent, (0.5, 0.6, 0.25), atol=1e-9)
    np.testing.assert_allclose(larger.T[:3, 3], (0.4, 0.15, 0.2), atol=1e-9)
    smallest = drag(partial(nodes._resized, "zone"), position=np.array((-0.3, -5.0, 0.2)))
    assert smallest.extent[0] == MIN_SIZE
    turned = drag(partial(nodes._turned, "wall"), wxyz=np.array((0.0, 1.0, 0.0, 0.0)))
    np.testing.assert_allclose(turned.T[:3, :3], np.diag((1.0, -1.0, -1.0)), atol=1e-9)
    np.testing.assert_allclose(turned.T[:3, 3], T[:3, 3])


@settings(max_examples=30)
@given(st.floats(5e-3, 0.05), st.integers(0, 4))
def test_coarse_shape_is_near_the_fine_one(cell: float, subdivisions: int) -> None:
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.1)
    vertices, faces = coarse(ball.vertices, ball.faces, cell)
    assert len(faces) <= len(ball.faces)
    assert (np.abs(np.linalg.norm(vertices, axis=1) - 0.1) < np.sqrt(3.0) * cell).all()
    # Every face has three different corners, and no two faces coincide.
    corners = np.sort(faces, axis=1)
    assert (np.diff(corners, axis=1) > 0).all()
    assert len(np.unique(corners, axis=0)) == len(faces)
    assert faces.max(initial=0) < len(vertices)


def test_distant_corners_are_unchanged() -> None:
    cube = trimesh.creation.box((0.1, 0.2, 0.3))
    vertices, faces = coarse(cube.vertices, cube.faces, 1e-3)
    assert sorted(map(tuple, vertices.round(12))) == sorted(map(tuple, cube.vertices.round(12)))
    assert trimesh.Trimesh(vertices, faces).volume == cube.volume


def test_ghost_keeps_the_outline_of_the_arm(robot: Robot) -> None:
    before = after = 0
    for body in robot.links:
        for visual in body.visuals:
            vertices, faces = surface(visual)
            fine = visual.mesh
            before += len(fine.faces)
            after += len(faces)
            for end in (np.min, np.max):
                gap = end(vertices, axis=0) - end(fine.vertices, axis=0)
                assert np.abs(gap).max() < DETAIL + 2.0 * COAT_THICKNESS
    assert after < 0.7 * before
