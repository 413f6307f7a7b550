"""What a program would do, in the scene before it does: the tool's way, and the arm along it."""

from __future__ import annotations

import threading

import numpy as np
import viser

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.extensions.programs.actions import FollowPlan, UseTool
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.timeline import Timeline
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.server.view.scene import Colour, GhostNodes, surface
from katana450.server.viser_bridge.posing import arrange

COLOUR: Colour = (64, 156, 255)

PATH_SAMPLES = 60
"""Pieces that the way of each plan is drawn with."""

GHOSTS = 7
"""Postures of the arm along the whole way."""

FAINT, CLEAR = 0.06, 0.26
"""How opaque the first and the last of them are."""

LOOK: Colour = (255, 153, 0)
LOOK_OPACITY = 0.5


class Preview:
    """The line is there until another program is; the ghosts until it runs.

    They are sent when they are first wanted: their shapes are as much as a sixth of the page.
    """

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        self._server = server
        self._robot = robot
        self._way = server.scene.add_line_segments(
            "/path/preview",
            np.zeros((1, 2, 3), dtype=np.float32),
            COLOUR,
            thickness=0.002,
            visible=False,
        )
        self._sweep: GhostSweep | None = None
        self._ghost: GhostNodes | None = None
        self._timeline: Timeline | None = None
        # A hand on the slider is heard in a thread of viser's.
        self._lock = threading.Lock()

    def show(self, program: Program | None, tool: str, *, ghosts: bool) -> float:
        """Draw ``program``, which begins with ``tool``; tells how long it is [s], 0 for nothing."""
        with self._lock:
            self._hide_ghosts()
            ways = [] if program is None else _ways(self._robot.require_arm(), program, tool)
            if ways:
                self._way.points = np.concatenate(ways).astype(np.float32)
            self._way.visible = bool(ways)
            self._timeline = Timeline.of(program) if program is not None and ways else None
            if self._timeline is None:
                return 0.0
            if ghosts:
                if self._sweep is None:
                    self._sweep = GhostSweep(self._server, self._robot)
                self._sweep.show(self._timeline)
            return self._timeline.span

    def look(self, t: float) -> None:
        """Show the arm at ``t`` [s] of what is drawn; at 0 nothing."""
        with self._lock:
            timeline = self._timeline
            if timeline is None or t <= 0.0:
                if self._ghost is not None:
                    self._ghost.show(False, LOOK)
                return
            if self._ghost is None:
                self._ghost = GhostNodes(
                    self._server, self._robot, "/path/ghost", LOOK, LOOK_OPACITY
                )
            self._ghost.move(self._robot.joint_values(*timeline.at(t)))
            self._ghost.show(True, LOOK)

    def begin(self) -> None:
        """It runs: the arm itself is to be seen."""
        with self._lock:
            self._hide_ghosts()
            self._timeline = None

    def _hide_ghosts(self) -> None:
        if self._sweep is not None:
            self._sweep.hide()
        if self._ghost is not None:
            self._ghost.show(False, LOOK)


class GhostSweep:
    """The arm in several postures at once, each shape sent once and the first the faintest."""

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        self._robot = robot
        self._root = server.scene.add_frame("/path/sweep", show_axes=False, visible=False)
        still = np.tile((1.0, 0.0, 0.0, 0.0), (GHOSTS, 1)), np.zeros((GHOSTS, 3))
        self._nodes: list[tuple[str, viser.BatchedMeshHandle]] = [
            (
                link.name,
                server.scene.add_batched_meshes_simple(
                    f"/path/sweep/{link.name}{number}",
                    *surface(visual),
                    *still,
                    batched_colors=COLOUR,
                    batched_opacities=np.linspace(FAINT, CLEAR, GHOSTS),
                    # The browser would work out coarser shapes, which takes it long.
                    lod="off",
                    opacity=1.0,
                    cast_shadow=False,
                    receive_shadow=False,
                ),
            )
            for link in robot.links
            for number, visual in enumerate(link.visuals)
            if link.name in robot.moving
        ]

    def show(self, timeline: Timeline) -> None:
        """Postures evenly in time, from start to end."""
        placed = [
            self._robot.frames(self._robot.joint_values(*each))
            for each in timeline.postures(GHOSTS)
        ]
        for name, node in self._nodes:
            poses = np.array([each[name] for each in placed])
            wxyzs = np.array([so3.to_quaternion(T[:3, :3]) for T in poses], dtype=np.float32)
            arrange(node, wxyzs, np.ascontiguousarray(poses[:, :3, 3], dtype=np.float32))
        self._root.visible = True

    def hide(self) -> None:
        """Show none of them."""
        if self._root.visible:
            self._root.visible = False


def _ways(arm: MountedArm, program: Program, tool: str) -> list[FloatArray]:
    """Of each plan the way of the tool, (PLACES, 2, 3) in the base frame [m]."""
    ways: list[FloatArray] = []
    for task in program.tasks:
        if isinstance(task.order, UseTool):
            tool = task.order.name
        elif isinstance(task.order, FollowPlan):
            chain = arm.chain_to(tool)
            postures = task.order.plan.postures(PATH_SAMPLES + 1)
            points = [(arm.T_base_shoulder @ forward(chain, q))[:3, 3] for q in postures]
            ways.append(np.stack((points[:-1], points[1:]), axis=1))
    return ways
