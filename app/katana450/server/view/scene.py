"""The arm in the scene: a tree of frames that each turn or slide, and its ghost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

import numpy as np
import numpy.typing as npt
import viser

from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import VisualMesh, smooth_normals
from katana450.arm.robot.visual import Visual
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.viser_bridge.posing import Quaternion, place, turn
from katana450.srgb import to_light

Colour = tuple[int, int, int]
"""Red, green and blue, each from 0 to 255."""

Window = viser.ViserServer | viser.ClientHandle
"""The end of all windows, or of one window: the owner of a scene."""

ANGLE_WORTH_SENDING = 1e-7
"""Smallest change of a joint [rad or m] that is sent: less than 0.1 um at a tool 0.6 m away."""

GAP_WORTH_SEEING = 1e-3
"""Smallest distance [m] between target and goal that is drawn."""


def node_name(name: str) -> str:
    """Return the last part of the path of the node of a link or an object ``name``.

    A name may contain the separator of paths. The page finds the node by the same rule, which is
    that of ``encodeURIComponent`` (``static/scene/joints.js``, ``static/scene/selection.js``).
    """
    return quote(name, safe="!~*'()")


@dataclass
class _Jointed:
    """A link that turns, and the angle that was sent last.

    Its quaternion is ``cos(angle / 2) * straight + sin(angle / 2) * across``.

    Attributes:
        joint: name of the joint.
        frame: node of the link.
        straight: quaternion (4,) at the joint's zero.
        across: quaternion (4,) half a turn further.
        angle: angle [rad] that was sent last.
    """

    joint: str
    frame: viser.FrameHandle
    straight: list[float]
    across: list[float]
    angle: float = math.inf

    def move(self, angle: float) -> None:
        """Send the rotation of the link for the joint at ``angle`` [rad]."""
        turn(self.frame, self.at(angle))

    def at(self, angle: float) -> Quaternion:
        """Return the rotation of the link in its parent with the joint at ``angle`` [rad]."""
        c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
        w, x, y, z = (c * a + s * b for a, b in zip(self.straight, self.across, strict=True))
        return w, x, y, z


@dataclass
class _Sliding:
    """A link that slides, and the joint value that was sent last.

    Attributes:
        joint: name of the joint.
        frame: node of the link.
        start: position (3,) [m] at the joint's zero.
        direction: unit vector (3,) of the motion in the parent.
        angle: value of the joint [m] that was sent last.
    """

    joint: str
    frame: viser.FrameHandle
    start: FloatArray
    direction: FloatArray
    angle: float = math.inf

    def move(self, value: float) -> None:
        """Send the position of the link for the joint at ``value`` [m]."""
        x, y, z = (self.start + value * self.direction).tolist()
        place(self.frame, (x, y, z))


class FrameTree:
    """One viser frame per link, nested as the links are. Subclasses add the shapes."""

    def __init__(self, server: Window, root: str, robot: Robot) -> None:
        """Add the frames below the new node ``root``, for instance ``/arm``."""
        self._server = server
        self.root = server.scene.add_frame(root, show_axes=False)
        self.path: dict[str, str] = {}
        self._joints: list[_Jointed | _Sliding] = []
        for link in robot.links:
            parent = root if link.parent is None else self.path[link.parent]
            self.path[link.name] = f"{parent}/{node_name(link.name)}"
            R, position, joint = link.T_parent_link[:3, :3], link.T_parent_link[:3, 3], link.joint
            straight = so3.to_quaternion(R)
            frame = server.scene.add_frame(
                self.path[link.name], show_axes=False, wxyz=straight, position=position
            )
            if joint is not None and joint.slides:
                self._joints.append(_Sliding(joint.name, frame, position, R @ joint.axis))
            elif joint is not None:
                across = so3.quaternion_product(straight, (0.0, *joint.axis))
                self._joints.append(_Jointed(joint.name, frame, straight.tolist(), across.tolist()))

    def move(self, angles: Mapping[str, float]) -> None:
        """Place the links for the joint ``angles`` [rad or m]. Only changes are sent."""
        for jointed in self._joints:
            angle = angles[jointed.joint]
            if abs(angle - jointed.angle) > ANGLE_WORTH_SENDING:
                jointed.angle = angle
                jointed.move(angle)

    def show_moving(self, visible: bool) -> None:
        """Show or hide the links that a joint moves. Only changes are sent."""
        for jointed in self._joints:
            if jointed.frame.visible != visible:
                jointed.frame.visible = visible


class ArmNodes(FrameTree):
    """A robot itself, drawn with the normals and the materials of its files."""

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        super().__init__(server, "/arm", robot)
        for link in robot.links:
            for number, visual in enumerate(link.visuals):
                if visual.glb is not None or link.shapes_by_visual[number]:
                    _draw(server, f"{self.path[link.name]}/shape{number}", link, number)


def _draw(server: Window, name: str, link: Link, number: int) -> None:
    """Draw the visual of this ``number`` of ``link`` as the node ``name``."""
    visual = link.visuals[number]
    if visual.glb is None:
        server.scene.add_glb(name, glb(link.shapes_by_visual[number]))
    else:
        server.scene.add_glb(
            name,
            visual.glb.read_bytes(),
            wxyz=so3.to_quaternion(visual.T_body_visual[:3, :3]),
            position=visual.T_body_visual[:3, 3],
        )


def glb(shapes: Sequence[VisualMesh]) -> bytes:
    """Return a binary glTF file of ``shapes`` with their normals and materials."""
    # Imported here, because the import takes longer than the rest of the start.
    import trimesh

    # It has no types for materials.
    looks: Any = trimesh.visual
    scene: Any = trimesh.Scene()
    for shape in shapes:
        name, colour, metallic, rough = shape.material
        material = looks.material.PBRMaterial(name, metallicFactor=metallic, roughnessFactor=rough)
        material.baseColorFactor = [*to_light(colour), 1.0]
        mesh: Any = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
        mesh.vertex_normals = shape.normals
        mesh.visual = looks.TextureVisuals(material=material)
        scene.add_geometry(mesh)
    return bytes(scene.export(file_type="glb", include_normals=True))


COAT_THICKNESS = 2e-3
"""Distance [m] of the ghost's surface from the arm's, so that they do not flicker in one place."""


DETAIL = 3e-3
"""Size [m] of the smallest details of a ghost.

Smaller ones are invisible in a translucent body of one colour. Without them the ghost needs a
quarter fewer bytes.
"""


class GhostNodes(FrameTree):
    """The translucent arm at the goal, or at a branch that can be chosen, in one colour."""

    def __init__(
        self, server: Window, robot: Robot, root: str, colour: Colour, opacity: float
    ) -> None:
        """Add the ghost below the new node ``root``, hidden."""
        super().__init__(server, root, robot)
        self.root.visible = False
        self._colour = colour
        self.shapes = [
            server.scene.add_mesh_simple(
                f"{self.path[link.name]}/shape{number}",
                *surface(visual),
                color=colour,
                opacity=opacity,
                flat_shading=visual.glb is None,
                cast_shadow=False,
                receive_shadow=False,
            )
            for link in robot.links
            for number, visual in enumerate(link.visuals)
            if link.name in robot.moving
        ]

    def show(self, visible: bool, colour: Colour) -> None:
        """Show the ghost in ``colour`` or hide it."""
        if visible != self.root.visible:
            self.root.visible = visible
        if visible and colour != self._colour:
            self._colour = colour
            for shape in self.shapes:
                shape.color = colour


class Gap:
    """A line from the target of the tool point to its goal."""

    COLOUR = (255, 128, 0)

    def __init__(self, server: viser.ViserServer) -> None:
        self._line = server.scene.add_line_segments(
            "/target/gap", np.zeros((1, 2, 3)), self.COLOUR, thickness=0.004, visible=False
        )

    def show(self, desired: FloatArray | None, goal: FloatArray) -> None:
        """Draw the line between two points (3,) [m] in the base frame; hide it without a gap."""
        visible = desired is not None and bool(np.abs(desired - goal).max() > GAP_WORTH_SEEING)
        if visible != self._line.visible:
            self._line.visible = visible
        if visible:
            ends = np.array([[desired, goal]], dtype=np.float32)
            if not np.array_equal(ends, self._line.points):
                self._line.points = ends


def surface(visual: Visual) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return vertices (n, 3) [m] and faces (m, 3) of a shape without materials and details."""
    return visual.kept(lambda: _surface(visual), tuple[npt.NDArray[Any], npt.NDArray[Any]])


def _surface(visual: Visual) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    mesh = visual.mesh.copy()
    # One vertex per corner halves the data that is sent.
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    return coarse(vertices + COAT_THICKNESS * smooth_normals(vertices, faces), faces, DETAIL)


def coarse(
    vertices: FloatArray, faces: npt.NDArray[Any], cell: float
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return vertices (n, 3) and faces (m, 3) with the vertices of each cubic ``cell`` [m] merged.

    Vertex clustering (Rossignac and Borrel 1993): a vertex moves by less than the cell's diagonal.
    Faces that collapse to an edge or coincide with another face are removed.
    """
    _, into = np.unique(np.round(vertices / cell), axis=0, return_inverse=True)
    into = into.ravel()
    fraction = np.bincount(into)
    merged = np.stack([np.bincount(into, weights=x) / fraction for x in vertices.T], axis=1)
    left = into[faces]
    left = left[(left != np.roll(left, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(left, axis=1), axis=0, return_index=True)
    return merged, left[np.sort(first)]
