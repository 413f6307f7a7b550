"""The arm in the browser: a tree of frames that each turn or slide, and its ghost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import VisualMesh
from katana450.arm.robot.visual import Visual
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.viser_bridge.posing import Quaternion, place, turn

Colour = tuple[int, int, int]
"""Red, green, blue of 255."""

ANGLE_WORTH_SENDING = 1e-7
"""[rad or m] A joint that moved less than this would move a tool 0.6 m away by less than 0.1 um."""

GAP_WORTH_SEEING = 1e-3
"""[m]"""


@dataclass
class _Jointed:
    """A link that turns, as it was last sent.

    straight, across: its quaternions (4,) at the joint's zero and half a turn on; all others are
    cos(angle / 2) of the one and sin(angle / 2) of the other. angle: that sent [rad].
    """

    joint: str
    frame: viser.FrameHandle
    straight: list[float]
    across: list[float]
    angle: float = math.inf

    def move(self, angle: float) -> None:
        """Send its turn for the joint at ``angle`` [rad]."""
        turn(self.frame, self.at(angle))

    def at(self, angle: float) -> Quaternion:
        """Its turn in its parent with the joint at ``angle`` [rad]."""
        c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
        w, x, y, z = (c * a + s * b for a, b in zip(self.straight, self.across, strict=True))
        return w, x, y, z


@dataclass
class _Sliding:
    """A link that slides, as it was last sent.

    start, way: (3,) its place at the joint's zero and what a metre of the joint adds to it [m].
    angle: the value of the joint that was sent [m].
    """

    joint: str
    frame: viser.FrameHandle
    start: FloatArray
    way: FloatArray
    angle: float = math.inf

    def move(self, value: float) -> None:
        """Send its place for the joint at ``value`` [m]."""
        x, y, z = (self.start + value * self.way).tolist()
        place(self.frame, (x, y, z))


class FrameTree:
    """One viser frame a link, nested as the links are; shapes are hung below by a subclass."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """``root``: name of the node that carries the tree, for instance ``/arm``."""
        self._server = server
        self.root = server.scene.add_frame(root, show_axes=False)
        self.path: dict[str, str] = {}
        self._joints: list[_Jointed | _Sliding] = []
        for link in robot.links:
            parent = root if link.parent is None else self.path[link.parent]
            self.path[link.name] = f"{parent}/{link.name}"
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
        """Bring the links to the joint ``angles`` [rad or m]; sends only what changed."""
        for jointed in self._joints:
            angle = angles[jointed.joint]
            if abs(angle - jointed.angle) > ANGLE_WORTH_SENDING:
                jointed.angle = angle
                jointed.move(angle)


class ArmNodes(FrameTree):
    """The arm itself: GLB files as they are, so that normals and materials are kept."""

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        super().__init__(server, "/arm", robot)
        self.shapes = {
            link.name: [
                _as_made(server, f"{self.path[link.name]}/shape{number}", visual)
                for number, visual in enumerate(link.visuals)
            ]
            for link in robot.links
        }
        """Of each link, as they are made."""
        self._links = {link.name: link for link in robot.links}

    def surfaces(self, link: str) -> Sequence[VisualMesh]:
        """Return the surfaces of a link, one per material."""
        return self._links[link].shapes


def _as_made(
    server: viser.ViserServer, name: str, visual: Visual
) -> viser.GlbHandle | viser.MeshHandle:
    if visual.glb is None:
        mesh = visual.mesh
        return server.scene.add_mesh_simple(
            name, mesh.vertices, mesh.faces, color=visual.colour, flat_shading=True
        )
    return server.scene.add_glb(
        name,
        visual.glb.read_bytes(),
        wxyz=so3.to_quaternion(visual.T_body_visual[:3, :3]),
        position=visual.T_body_visual[:3, 3],
    )


COAT = 2e-3
"""[m] The ghost is this much thicker than the arm: where both are in one place it coats the arm
instead of flickering in it."""


DETAIL = 3e-3
"""[m] Smaller things cannot be told in what is translucent and of one colour; without them it takes
a quarter fewer bytes."""


class GhostNodes(FrameTree):
    """Where the arm is going, or could go: the same links, translucent, in one colour."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        root: str,
        colour: Colour,
        opacity: float,
    ) -> None:
        """``root``: name of its node; it is made hidden."""
        super().__init__(server, root, robot)
        self.root.visible = False
        self._colour = colour
        self.shapes = [
            server.scene.add_mesh_simple(
                f"{self.path[link.name]}/shape{number}",
                *surface(visual),
                color=colour,
                opacity=opacity,
                cast_shadow=False,
                receive_shadow=False,
            )
            for link in robot.links
            for number, visual in enumerate(link.visuals)
            if link.name in robot.moving
        ]

    def show(self, visible: bool, colour: Colour) -> None:
        """Show or hide the ghost, in ``colour`` (red, green, blue of 255)."""
        if visible != self.root.visible:
            self.root.visible = visible
        if visible and colour != self._colour:
            self._colour = colour
            for shape in self.shapes:
                shape.color = colour


class Gap:
    """A line from where the tool was wished to where it can go."""

    COLOUR = (255, 128, 0)

    def __init__(self, server: viser.ViserServer) -> None:
        self._line = server.scene.add_line_segments(
            "/target/gap", np.zeros((1, 2, 3)), self.COLOUR, thickness=0.004, visible=False
        )

    def show(self, desired: FloatArray | None, goal: FloatArray) -> None:
        """Draw it between two points (3,) [m] in the base frame; hide it where there is no gap."""
        visible = desired is not None and bool(np.abs(desired - goal).max() > GAP_WORTH_SEEING)
        if visible != self._line.visible:
            self._line.visible = visible
        if visible:
            ends = np.array([[desired, goal]], dtype=np.float32)
            if not np.array_equal(ends, self._line.points):
                self._line.points = ends


def surface(visual: Visual) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Vertices (n, 3) [m] and faces (m, 3) of a shape without its materials and small details."""
    mesh = visual.mesh.copy()
    # One vertex a corner: half of what goes over the wire.
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return coarse(mesh.vertices + COAT * mesh.vertex_normals, np.asarray(mesh.faces), DETAIL)


def coarse(
    vertices: FloatArray, faces: npt.NDArray[Any], cell: float
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Vertices (n, 3) and faces (m, 3) with all vertices of a cubic ``cell`` [m] made one.

    Vertex clustering (Rossignac and Borrel 1993): a vertex moves by less than the cell's diagonal,
    and faces that have come down to an edge or lie on another are gone.
    """
    _, into = np.unique(np.round(vertices / cell), axis=0, return_inverse=True)
    into = into.ravel()
    fraction = np.bincount(into)
    merged = np.stack([np.bincount(into, weights=x) / fraction for x in vertices.T], axis=1)
    left = into[faces]
    left = left[(left != np.roll(left, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(left, axis=1), axis=0, return_index=True)
    return merged, left[np.sort(first)]


def add_shape(
    server: viser.ViserServer, name: str, shape: VisualMesh, colour: tuple[float, float, float]
) -> viser.MeshHandle:
    """A shape in one colour, sRGB 0..1."""
    faces = shape.faces.astype(np.uint32)
    return server.scene.add_mesh_simple(
        name, shape.vertices.astype(np.float32), faces, color=of_255(colour)
    )


def of_255(colour: tuple[float, float, float]) -> Colour:
    """As viser counts colours."""
    red, green, blue = (round(255.0 * part) for part in colour)
    return red, green, blue
