"""Preview of a program in the scene: the path of the tool, and the arm and objects along it.

The page chooses the time by the request `preview`.
"""

from __future__ import annotations

import logging
import threading
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.errors import KatanaError
from katana450.extensions.programs.building.actions import FollowPlan, GiveCommand
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.simulation import Moment, moments
from katana450.extensions.programs.server.program_runner import ProgramRunner
from katana450.extensions.programs.server.traces import DRIVEN
from katana450.extensions.water import WaterNodes
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.water.flow import MotionWithWater, Water
from katana450.server.view.layer import FolderContext
from katana450.server.view.scene import Colour, GhostNodes, Window
from katana450.server.view.scene_objects import ObjectShape

ROOT = "/path"
"""Node above all ghosts of a preview."""

SAME_PLACE = 1e-4
"""Change of a pose [m or 1] up to which an object counts as unmoved, and has no ghost."""


class GhostScene:
    """Objects and water at some time: what a program has moved, or what was recorded."""

    def __init__(
        self, server: Window, colour: Colour | None, opacity: float, root: str = ROOT
    ) -> None:
        """Prepare the ghosts below the node ``root``; each is sent when it is first shown.

        ``colour``: that of all objects; None to draw each as it is. ``server``: the server, or one
        of its clients, which alone shows them then.
        """
        self._server = server
        self._root = root
        self._colour = colour
        self._opacity = opacity
        self._props = load_props()
        self._shapes: dict[str, tuple[viser.FrameHandle, ObjectShape]] = {}
        self._water: WaterNodes | None = None

    def show(self, session: Session, start: State, state: State) -> None:
        """Show what differs in ``state`` from ``start``, both of ``session``."""
        now = {start_object.name: start_object for start_object in start.objects}
        moved = []
        for scene_object in state.objects:
            T = session.environment.pose(scene_object, state.x)
            before = now.get(scene_object.name)
            if before is not None:
                change = np.abs(T - session.environment.pose(before, start.x)).max()
                if change <= SAME_PLACE:
                    continue
            moved.append((scene_object, T))
        self.place(moved)
        changed = _amounts(start.poured) != _amounts(state.poured)
        self.pour(session, state.objects, state.poured.water if state.poured and changed else None)

    def place(self, poses: Iterable[tuple[SceneObject, FloatArray]]) -> None:
        """Show these objects in their poses (4, 4) in the base frame, and no others."""
        shown = set()
        for scene_object, T in poses:
            frame = self._drawn(scene_object)
            frame.position, frame.wxyz = T[:3, 3], so3.to_quaternion(T[:3, :3])
            frame.visible = True
            shown.add(scene_object.name)
        for name, (frame, _) in self._shapes.items():
            if name not in shown:
                frame.visible = False

    def hide(self) -> None:
        """Hide all ghosts."""
        self.place(())
        if self._water is not None:
            self._water.hide()

    def _drawn(self, scene_object: SceneObject) -> viser.FrameHandle:
        name = scene_object.name
        if name not in self._shapes:
            path = f"{self._root}/objects/{len(self._shapes)}"
            frame = self._server.scene.add_frame(path, show_axes=False, visible=False)
            # A mesh is shown as the convex body that the collision checks use.
            shape = ObjectShape(self._server, path, Meshes(), self._props)
            self._shapes[name] = frame, shape
        frame, shape = self._shapes[name]
        look = scene_object.appearance
        if self._colour is not None:
            look = replace(look, colour=self._colour, opacity=self._opacity)
        shape.follow(replace(scene_object, appearance=look))
        return frame

    def pour(self, session: Session, objects: Sequence[SceneObject], water: Water | None) -> None:
        """Show ``water`` among ``objects``; hide it if there is none."""
        pouring = session.pouring
        if pouring is None or water is None:
            if self._water is not None:
                self._water.hide()
            return
        water_environment = pouring.water_environment(objects)
        if self._water is None:
            self._water = WaterNodes(self._server, water_environment, f"{self._root}/water")
        self._water.stand(water_environment)
        self._water.show(water)


def _amounts(poured: MotionWithWater | None) -> tuple[int, ...]:
    """Return the water in the basin and in the vessels [fl]."""
    if poured is None:
        return (0, 0)
    return poured.water.basin, *(vessel.volume for vessel in poured.water.vessels)


log = logging.getLogger(__name__)

COLOUR: Colour = (64, 156, 255)
"""Colour of the path."""

PATH_SAMPLES = 60
"""Number of line segments with which the tool's path of one plan is drawn."""

LOOK: Colour = (255, 153, 0)
"""Colour of the ghost at the slider's time."""
LOOK_OPACITY = 0.5
"""Opacity of the ghost at the slider's time."""


class PreviewNodes:
    """The path line, kept until the arm is driven after the run, and a ghost, kept until it runs.

    The ghost is sent when it is first shown. The program is simulated in a thread, which takes a
    second for a minute of motion. Until then a later time shows the newest simulated state.
    """

    def __init__(
        self, server: viser.ViserServer, robot: Robot, session: Callable[[], Session]
    ) -> None:
        """Add the hidden path line to the scene. ``session`` returns the rules of the arm."""
        self._server = server
        self._robot = robot
        self._session = session
        self._path_line = server.scene.add_line_segments(
            "/path/preview",
            np.zeros((1, 2, 3), dtype=np.float32),
            COLOUR,
            thickness=0.002,
            visible=False,
        )
        self._ghost: GhostNodes | None = None
        self._ghost_scene: GhostScene | None = None
        self._shown: _Shown | None = None
        # A time is shown in a thread of its own, see `ProgramPreview`.
        self._lock = threading.Lock()

    def show(self, program: Program | None, state: State) -> None:
        """Draw ``program``, which begins in ``state``; None draws nothing."""
        with self._lock:
            self._hide_ghost()
            self._shown = None
            arm = self._robot.require_arm()
            paths = [] if program is None else _tool_paths(arm, program, state.tool)
            if paths:
                self._path_line.points = np.concatenate(paths).astype(np.float32)
            self._path_line.visible = bool(paths)
            if program is not None and program.preview_time > 0.0:
                self._shown = _Shown(program, state)

    def look(self, t: float) -> None:
        """Show arm, objects and water at the time ``t`` [s] of the preview; hide them at 0."""
        with self._lock:
            shown = self._shown
            if shown is None or t <= 0.0:
                self._hide_ghost()
                return
            shown.look = t
            if not shown.simulated:
                self._simulate(shown)
            state = shown.at(t)
            if state is None:
                return
            if self._ghost is None:
                self._ghost = GhostNodes(
                    self._server, self._robot, "/path/ghost", LOOK, LOOK_OPACITY
                )
            self._ghost.move(self._robot.joint_values(state.q, state.gripper))
            self._ghost.show(True, LOOK)
            self._objects().show(self._session(), shown.start, state)

    def begin(self) -> None:
        """Hide the ghost, because the program runs and the arm itself shows it."""
        with self._lock:
            self._hide_ghost()
            self._shown = None

    def end(self) -> None:
        """Hide the path line, because the program has ended and the arm is driven again."""
        with self._lock:
            if self._path_line.visible:
                self._path_line.visible = False

    def _simulate(self, shown: _Shown) -> None:
        shown.simulated = True

        def simulate() -> None:
            try:
                for moment in moments(shown.program, self._session(), shown.start):
                    if self._shown is not shown:
                        return
                    shown.moments.append(moment)
            except KatanaError as error:
                log.debug("The preview ends before the program: %s", error)
            except Exception:
                log.exception("The preview met an error.")
            if shown.look > 0.0:
                self.look(shown.look)

        threading.Thread(target=simulate, name="preview", daemon=True).start()

    def _objects(self) -> GhostScene:
        if self._ghost_scene is None:
            self._ghost_scene = GhostScene(self._server, LOOK, LOOK_OPACITY)
        return self._ghost_scene

    def _hide_ghost(self) -> None:
        if self._ghost is not None:
            self._ghost.show(False, LOOK)
        if self._ghost_scene is not None:
            self._ghost_scene.hide()


@dataclass
class _Shown:
    """The program that is shown, and what is known of it.

    Attributes:
        program: the program.
        start: the state in which it begins.
        moments: the simulated states so far, in the order of their times.
        simulated: whether the simulation has begun.
        look: the time that was looked at last [s].
    """

    program: Program
    start: State
    moments: list[Moment] = field(default_factory=list)
    simulated: bool = False
    look: float = 0.0

    def at(self, t: float) -> State | None:
        """Return the newest simulated state up to ``t`` [s]; None before the first."""
        number = bisect_right(self.moments, t, key=lambda moment: moment.t)
        return self.moments[number - 1].state if number else None


def _tool_paths(arm: MountedArm, program: Program, tool: str) -> list[FloatArray]:
    """Return the tool's path of each expected plan, (PATH_SAMPLES, 2, 3) in the base frame [m]."""
    paths: list[FloatArray] = []
    for task in program.schedule:
        match program.tasks[task.number].action:
            case GiveCommand(command=cmd.Tool(name=name)):
                tool = name
            case FollowPlan(plan=plan, tau=tau):
                chain = arm.chain_to(tool)
                postures = plan.postures(PATH_SAMPLES + 1, tau)
                points = [(arm.T_base_shoulder @ forward(chain, q))[:3, 3] for q in postures]
                paths.append(np.stack((points[:-1], points[1:]), axis=1))
    return paths


class ProgramPreview:
    """The preview of the program that is planned: its path, and the time that the page chooses."""

    def __init__(
        self,
        runner: ProgramRunner,
        preview: PreviewNodes,
        state: Callable[[], State],
    ) -> None:
        """Follow ``runner``, whose requests show a time; ``state`` returns the newest state."""
        self._runner, self._preview, self._state = runner, preview, state
        self._drawn: Program | None = None
        self._begun = False
        # Drawing a ghost for the first time takes longer than the server's thread may wait.
        self._painter = ThreadPoolExecutor(1, "preview")
        runner.show_preview = lambda: self._painter.submit(self._look)

    def _look(self) -> None:
        """Show the newest time; of several requests that waited, all show the last one."""
        try:
            self._preview.look(self._runner.look_time or 0.0)
        except Exception:
            log.exception("The preview met an error.")

    def follow(self) -> None:
        """Draw a new program, and hide the preview once it runs or the arm is driven after it."""
        program, has_begun = self._runner.drawn, self._runner.begun
        if program is not self._drawn or (self._begun and not has_begun):
            self._drawn, self._begun = program, False
            self._preview.show(program, self._state())
        if has_begun and not self._begun:
            self._preview.begin()
        self._begun = has_begun
        if has_begun and not self._runner.running and isinstance(self._state().mode, DRIVEN):
            self._preview.end()


def program_preview(context: FolderContext) -> ProgramPreview | None:
    """Return the preview of the programs of a server; None for a robot without an arm."""
    hub = context.hub
    # Another extension may provide the only runner of this server.
    if context.robot.arm is None or not isinstance(hub.runner, ProgramRunner):
        return None
    preview = PreviewNodes(context.server, context.robot, lambda: hub.present().session)
    return ProgramPreview(hub.runner, preview, context.state)
