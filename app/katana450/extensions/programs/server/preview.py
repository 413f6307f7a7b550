"""Preview of a program in the scene: the path of the tool, and the arm along it."""

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
"""Colour of the path and of the ghosts."""

PATH_SAMPLES = 60
"""Number of line segments with which the tool's path of one plan is drawn."""

GHOSTS = 7
"""Number of ghost postures along the whole program."""

FAINT, CLEAR = 0.06, 0.26
"""Opacities of the first and of the last ghost."""

LOOK: Colour = (255, 153, 0)
"""Colour of the ghost at the slider's time."""
LOOK_OPACITY = 0.5
"""Opacity of the ghost at the slider's time."""


class Preview:
    """The path line, kept until another program is shown, and the ghosts, kept until it runs.

    The ghosts are sent when they are first shown: their shapes take up to a sixth of the page's
    data.
    """

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        """Add the hidden path line to the scene."""
        self._server = server
        self._robot = robot
        self._path_line = server.scene.add_line_segments(
            "/path/preview",
            np.zeros((1, 2, 3), dtype=np.float32),
            COLOUR,
            thickness=0.002,
            visible=False,
        )
        self._sweep: GhostSweep | None = None
        self._ghost: GhostNodes | None = None
        self._timeline: Timeline | None = None
        # The slider's callback runs in a thread of viser.
        self._lock = threading.Lock()

    def show(self, program: Program | None, tool: str, *, ghosts: bool) -> float:
        """Draw ``program``, which begins with ``tool``; return its duration [s], 0 for nothing."""
        with self._lock:
            self._hide_ghosts()
            paths = [] if program is None else _tool_paths(self._robot.require_arm(), program, tool)
            if paths:
                self._path_line.points = np.concatenate(paths).astype(np.float32)
            self._path_line.visible = bool(paths)
            self._timeline = Timeline.of(program) if program is not None and paths else None
            if self._timeline is None:
                return 0.0
            if ghosts:
                if self._sweep is None:
                    self._sweep = GhostSweep(self._server, self._robot)
                self._sweep.show(self._timeline)
            return self._timeline.span

    def look(self, t: float) -> None:
        """Show the arm at the time ``t`` [s] of the preview; hide it at 0."""
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
        """Hide the ghosts, because the program runs and the arm itself shows it."""
        with self._lock:
            self._hide_ghosts()
            self._timeline = None

    def _hide_ghosts(self) -> None:
        if self._sweep is not None:
            self._sweep.hide()
        if self._ghost is not None:
            self._ghost.show(False, LOOK)


class GhostSweep:
    """The arm in several postures at once. Each shape is sent once; opacity grows with time."""

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        """Add the hidden shapes of ``robot`` to the scene."""
        self._robot = robot
        self._root = server.scene.add_frame("/path/sweep", show_axes=False, visible=False)
        identity_poses = np.tile((1.0, 0.0, 0.0, 0.0), (GHOSTS, 1)), np.zeros((GHOSTS, 3))
        self._nodes: list[tuple[str, viser.BatchedMeshHandle]] = [
            (
                link.name,
                server.scene.add_batched_meshes_simple(
                    f"/path/sweep/{link.name}{number}",
                    *surface(visual),
                    *identity_poses,
                    batched_colors=COLOUR,
                    batched_opacities=np.linspace(FAINT, CLEAR, GHOSTS),
                    # Levels of detail would take the browser long to compute.
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
        """Show postures of ``timeline``, evenly spaced in time from start to end."""
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
        """Hide all postures."""
        if self._root.visible:
            self._root.visible = False


def _tool_paths(arm: MountedArm, program: Program, tool: str) -> list[FloatArray]:
    """Return the tool's path of each plan, (PATH_SAMPLES, 2, 3) in the base frame [m]."""
    paths: list[FloatArray] = []
    for task in program.tasks:
        if isinstance(task.action, UseTool):
            tool = task.action.name
        elif isinstance(task.action, FollowPlan):
            chain = arm.chain_to(tool)
            postures = task.action.plan.postures(PATH_SAMPLES + 1)
            points = [(arm.T_base_shoulder @ forward(chain, q))[:3, 3] for q in postures]
            paths.append(np.stack((points[:-1], points[1:]), axis=1))
    return paths
