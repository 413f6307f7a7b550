"""Scene objects in the scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.state.scene_objects import SceneObject, Shape, Zone
from katana450.arm.control.state.solid import Colour, Solid
from katana450.arm.control.state.state import State
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import Props
from katana450.arm.robot.surfaces import Drawn, drawn, glb
from katana450.arm.robot.visual import Visual
from katana450.maths.collision.engine import hull_triangles
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.server.view.scene import Window, node_name
from katana450.server.viser_bridge.posing import place, turn

COLOUR = (148, 163, 184)
"""Colour of an object without a colour of its own."""

ZONE_COLOURS, ZONE_OPACITY = {Zone.KEEP_OUT: (239, 130, 20), Zone.SLOW: (250, 204, 21)}, 0.25
"""Colours of zones without a colour of their own, and their maximum opacity."""

PROPS = ("cup", "basin")
"""Objects whose nodes have their names."""

SHEET = 0.002
"""[m] Thickness of a plane as it is drawn."""

FACETS = 48
"""Number of facets of a cylinder."""


class SceneObjectNodes:
    """One frame per scene object with its shape, which is made again when it changes."""

    def __init__(
        self,
        server: viser.ViserServer,
        props: Props,
        environment: Environment,
        meshes: Meshes,
    ) -> None:
        """Prepare for objects on ``server``.

        Args:
            server: viser's server.
            props: Table, cup and basin.
            environment: The supports and links to which objects are fixed.
            meshes: The meshes of objects.
        """
        self._server = server
        self._props = props
        self._environment = environment
        self._meshes = meshes
        self._frames: dict[str, viser.FrameHandle] = {}
        self._shapes: dict[str, ObjectShape] = {}
        self._objects: dict[str, SceneObject] = {}
        self._seen: tuple[SceneObject, ...] = ()

    def follow(self, state: State) -> None:
        """Show the objects of ``state``."""
        changed = state.objects is not self._seen
        if changed:
            self._take_in(state.objects)
        for scene_object in state.objects:
            if changed or scene_object.carried:
                self._pose(scene_object, state.x)

    def _take_in(self, objects: tuple[SceneObject, ...]) -> None:
        self._seen = objects
        self._objects = {scene_object.name: scene_object for scene_object in objects}
        for name in set(self._frames) - set(self._objects):
            self._take_away(name)
        for scene_object in objects:
            if scene_object.name not in self._frames:
                self._add(scene_object.name)
            frame, shape = self._frames[scene_object.name], self._shapes[scene_object.name]
            shape.follow(scene_object)
            if frame.visible == scene_object.appearance.hidden:
                frame.visible = not scene_object.appearance.hidden

    def _pose(self, scene_object: SceneObject, x: FloatArray) -> None:
        T = self._environment.pose(scene_object, x)
        px, py, pz = T[:3, 3].tolist()
        w, i, j, k = so3.to_quaternion(T[:3, :3]).tolist()
        place(self._frames[scene_object.name], (px, py, pz))
        turn(self._frames[scene_object.name], (w, i, j, k))

    def _add(self, name: str) -> None:
        path = f"/{name}" if name in PROPS else f"/objects/{node_name(name)}"
        self._frames[name] = self._server.scene.add_frame(path, show_axes=False)
        self._shapes[name] = ObjectShape(self._server, path, self._meshes, self._props)

    def _take_away(self, name: str) -> None:
        if name in PROPS:
            # It can come back, with the same node.
            self._frames[name].visible = False
            return
        del self._shapes[name]
        self._frames.pop(name).remove()


class ObjectShape:
    """The drawn shape of an object: a file in its own colours, or a surface in one colour."""

    def __init__(self, server: Window, path: str, meshes: Meshes, props: Props) -> None:
        """Prepare the shape below the node ``path``; ``props``: cup and basin."""
        self._scene = server.scene
        self._path = f"{path}/shape"
        self._meshes = meshes
        self._props = props
        self._node: Any = None
        self._is: tuple[object, ...] = ()

    def follow(self, scene_object: SceneObject) -> None:
        """Draw ``scene_object``. Only changes are sent."""
        own = scene_object.appearance.colour is None and self._own(scene_object) is not None
        key = None if scene_object.solid is None else scene_object.solid.key
        # A changed opacity requires to send the file again, but not the surface.
        now = (
            scene_object.shape,
            scene_object.size,
            key,
            own,
            scene_object.appearance.opacity if own else None,
            scene_object.zone,
        )
        if now != self._is:
            self._is = now
            self._node = self._made(scene_object, own=own)
        if not own:
            _set(self._node, "color", _colour(scene_object))
            _set(self._node, "opacity", _opacity(scene_object))
        _set(self._node, "scale", self._scale(scene_object))

    def _made(self, scene_object: SceneObject, *, own: bool) -> Any:
        # viser replaces the node of the name.
        if own:
            return self._scene.add_glb(
                self._path, self._own(scene_object) or b"", scale=self._scale(scene_object)
            )
        surface = self._surface(scene_object)
        return self._scene.add_mesh_simple(
            self._path,
            surface.vertices.astype(np.float32),
            surface.faces.astype(np.uint32),
            color=_colour(scene_object),
            opacity=_opacity(scene_object),
            side="double" if scene_object.shape is Shape.MESH else "front",
            cast_shadow=not scene_object.is_zone,
            receive_shadow=not scene_object.is_zone,
            scale=self._scale(scene_object),
        )

    def _scale(self, scene_object: SceneObject) -> float | tuple[float, float, float]:
        """Return the scale of the drawn file or surface."""
        prop = self._props.file_of(scene_object)
        return scene_object.scale if prop is None else prop[1]

    def _own(self, scene_object: SceneObject) -> bytes | None:
        """Return a GLB file of the object in its own colours; None without such colours."""
        if scene_object.solid is not None:
            mesh = self._meshes.get(scene_object.solid.key)
            if mesh is None or mesh.colours is None:
                return None
            return glb(mesh.drawn, scene_object.appearance.opacity)
        prop = self._props.file_of(scene_object)
        if prop is None or scene_object.appearance.opacity < 1.0:
            return None
        return prop[0].read_bytes()

    def _surface(self, scene_object: SceneObject) -> Drawn:
        if scene_object.solid is not None:
            mesh = self._meshes.get(scene_object.solid.key)
            if mesh is not None:
                return mesh.drawn
            # The arm's process knows this object from before the start of this process.
            return _of(_hull(scene_object.solid))
        prop = self._props.file_of(scene_object)
        if prop is not None:
            visual = Visual(frozen(np.eye(4)), frozen(np.ones(3)), prop[0])
            return visual.kept(lambda: _merged(visual), Drawn)
        return _of(_plain(scene_object))


def _merged(visual: Visual) -> Drawn:
    mesh = visual.mesh
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return _of(mesh)


def _hull(solid: Solid) -> Any:
    """Return the convex body that stands for a mesh."""
    import trimesh

    points, faces = solid.corners, hull_triangles(solid.corners)
    a, b, c = points[faces].transpose(1, 0, 2)
    outwards = np.cross(b - a, c - a)
    turned = np.einsum("mi,mi->m", outwards, a - points.mean(axis=0)) < 0.0
    faces[turned] = faces[turned, ::-1]
    return trimesh.Trimesh(points, faces)


def form(scene_object: SceneObject) -> Any:
    """Return a trimesh [m] of the object in its size, on z = 0 of its own frame; a mesh as hull."""
    mesh = _hull(scene_object.solid) if scene_object.solid is not None else _plain(scene_object)
    mesh.apply_scale(scene_object.scale)
    return mesh


def _plain(scene_object: SceneObject) -> Any:
    """Return a trimesh [m] of the object's shape at scale 1."""
    # Imported here, because the import takes longer than the rest of the start.
    import trimesh

    match scene_object.shape:
        case Shape.BOX:
            mesh, height = trimesh.creation.box(scene_object.size), scene_object.size[2]
        case Shape.PLANE:
            mesh, height = trimesh.creation.box((*scene_object.size, SHEET)), -SHEET
        case Shape.CYLINDER | Shape.VESSEL:
            radius, height = scene_object.size
            mesh = trimesh.creation.cylinder(radius, height, sections=FACETS)
        case _:
            height = 2.0 * scene_object.size[0]
            mesh = trimesh.creation.icosphere(subdivisions=3, radius=scene_object.size[0])
    mesh.apply_translation((0.0, 0.0, 0.5 * height))
    return mesh


def _of(mesh: Any) -> Drawn:
    return drawn(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def _colour(scene_object: SceneObject) -> Colour:
    return scene_object.appearance.colour or ZONE_COLOURS.get(scene_object.zone, COLOUR)


def _opacity(scene_object: SceneObject) -> float | None:
    opacity = scene_object.appearance.opacity
    if scene_object.is_zone:
        return min(opacity, ZONE_OPACITY)
    return None if opacity == 1.0 else opacity


def _set(node: Any, name: str, value: object) -> None:
    known = getattr(node, name)
    if isinstance(known, np.ndarray):
        known = tuple(known.tolist())
    if known != value:
        setattr(node, name, value)
