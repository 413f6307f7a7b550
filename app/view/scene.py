"""The arm in the browser: a tree of frames that move by rotation only, and its ghost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from app.geometry import so3
from app.geometry.arrays import FloatArray
from app.robot.model import Body, RobotModel
from app.robot.visual import Visual

Colour = tuple[int, int, int]
"""Red, green, blue of 255."""

ANGLE_WORTH_SENDING = 1e-7
"""[rad] A joint that moved less than this would move a tool 0.6 m away by less than 0.1 um."""

SMALL_FOR_VISER = 1e-4
"""Of a quaternion: above all that viser leaves unsent, which is 1e-5 of each of its numbers."""

GAP_WORTH_SEEING = 1e-3
"""[m]"""


class FrameTree:
    """One viser frame a link, nested as the links are; shapes are hung below by a subclass."""

    def __init__(self, server: viser.ViserServer, root: str, model: RobotModel) -> None:
        """``root``: name of the node that carries the tree, for instance ``/arm``."""
        self._server = server
        self.root = server.scene.add_frame(root, show_axes=False)
        self.path: dict[str, str] = {}
        self._joints: list[tuple[str, Body, viser.FrameHandle]] = []
        self._angles: dict[str, float] = {}
        for body in model.bodies:
            parent = root if body.parent is None else self.path[body.parent]
            self.path[body.name] = f"{parent}/{body.name}"
            frame = server.scene.add_frame(
                self.path[body.name],
                show_axes=False,
                wxyz=so3.to_quaternion(body.T_parent_body[:3, :3]),
                position=body.T_parent_body[:3, 3],
            )
            if body.joint is not None:
                self._joints.append((body.joint, body, frame))

    def move(self, angles: Mapping[str, float]) -> None:
        """Turn the links to the joint ``angles`` [rad]; sends only what changed."""
        for joint, body, frame in self._joints:
            angle = angles[joint]
            if abs(angle - self._angles.get(joint, np.inf)) > ANGLE_WORTH_SENDING:
                self._angles[joint] = angle
                R = body.T_parent_body[:3, :3] @ so3.exp(body.axis * angle)
                wxyz = so3.to_quaternion(R)
                # viser takes a small turn for none; -q is the same turn as q, and no small change.
                small = np.abs(wxyz - frame.wxyz).max() < SMALL_FOR_VISER
                frame.wxyz = -wxyz if small else wxyz


class ArmNodes(FrameTree):
    """The arm itself: GLB files as they are, so that normals and materials are kept."""

    def __init__(self, server: viser.ViserServer, model: RobotModel) -> None:
        super().__init__(server, "/arm", model)
        for body in model.bodies:
            for number, visual in enumerate(body.visuals):
                name = f"{self.path[body.name]}/shape{number}"
                if visual.glb is not None:
                    server.scene.add_glb(
                        name,
                        visual.glb.read_bytes(),
                        wxyz=so3.to_quaternion(visual.T_body_visual[:3, :3]),
                        position=visual.T_body_visual[:3, 3],
                    )
                else:
                    mesh = visual.mesh
                    server.scene.add_mesh_simple(
                        name, mesh.vertices, mesh.faces, color=visual.colour, flat_shading=True
                    )


COAT = 1e-3
"""[m] The ghost is this much thicker than the arm: where both are in one place it coats the arm
instead of flickering in it."""


class GhostNodes(FrameTree):
    """Where the arm is going, or could go: the same links, translucent, in one colour."""

    def __init__(
        self,
        server: viser.ViserServer,
        model: RobotModel,
        root: str,
        colour: Colour,
        opacity: float,
    ) -> None:
        """``root``: name of its node; it is made hidden."""
        super().__init__(server, root, model)
        self.root.visible = False
        self._colour = colour
        self.shapes = [
            server.scene.add_mesh_simple(
                f"{self.path[body.name]}/shape{number}",
                *surface(visual),
                color=colour,
                opacity=opacity,
                cast_shadow=False,
                receive_shadow=False,
            )
            for body in model.bodies
            for number, visual in enumerate(body.visuals)
            if body.moves
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

    def show(self, wished: FloatArray | None, goal: FloatArray) -> None:
        """Draw it between two points (3,) [m] in the base frame; hide it where there is no gap."""
        visible = wished is not None and bool(np.abs(wished - goal).max() > GAP_WORTH_SEEING)
        if visible != self._line.visible:
            self._line.visible = visible
        if visible:
            ends = np.array([[wished, goal]], dtype=np.float32)
            if not np.array_equal(ends, self._line.points):
                self._line.points = ends


def surface(visual: Visual) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Vertices (n, 3) [m] and faces (m, 3) of a shape, its materials forgotten."""
    mesh = visual.mesh.copy()
    # One vertex a corner: half of what goes over the wire.
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh.vertices + COAT * mesh.vertex_normals, np.asarray(mesh.faces)
