"""Pictures of a run at characteristic moments, as in the paper.

For an object that is carried and poured they correspond to the paper's Figs. 9 to 12. For a path
they show the arm on it, with the part that it has traced.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from trimesh.creation import cylinder
from trimesh.util import append_faces

from katana450.arm.control.state.state import State
from katana450.arm.robot.props import Props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.extensions.media.picture import Camera, Item, picture, png
from katana450.extensions.media.stage import RenderStage
from katana450.extensions.programs.run.simulation import Simulation
from katana450.extensions.programs.script.measures import commanded_errors, path_of
from katana450.extensions.programs.server.traces import DESIRED, PATH_SAMPLES, coloured
from katana450.extensions.programs.steps.pouring import POURING
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.path import point_derivatives
from katana450.server.view.cameras import camera_pose
from katana450.server.viser_bridge.presets import Preset

SIDES = 8
"""Number of sides of a tube."""

MIN_POINT_DISTANCE = 1e-5
"""[m] Minimum distance of distinct points."""


def tube(name: str, points: FloatArray, radius: float, rgb: tuple[int, int, int]) -> Item | None:
    """Return a tube along ``points`` (n, 3) [m] in the base frame; None if all are equal.

    ``rgb`` is the colour, 0 to 255.
    """
    far = np.linalg.norm(np.diff(points, axis=0), axis=1) > MIN_POINT_DISTANCE
    points = points[np.concatenate(([True], far))]
    if len(points) < 2:
        return None
    parts = [cylinder(radius, sections=SIDES, segment=pair) for pair in pairwise(points)]
    vertices, faces = append_faces(
        [part.vertices for part in parts], [part.faces for part in parts]
    )
    corners = vertices.astype(float)
    colour = rgb[0] / 255.0, rgb[1] / 255.0, rgb[2] / 255.0
    # Without normals of its own, each face has that of its plane.
    shape = VisualMesh(
        Material(name, colour), corners, np.zeros_like(corners), faces.astype(np.int64)
    )
    return Item(shape, np.eye(4))


SIZE = 880, 550
"""Width and height of a picture [px]."""

FOV = float(np.deg2rad(36.0))
"""Vertical field of view [rad]."""

ON_TABLE = (1.06, 0.66, 0.70), (0.19, 0.04, 0.21)
"""[m] Position and target of the camera for cup, basin and hand."""

ON_PATH = (0.88, -0.95, 0.66), (0.13, -0.02, 0.185)
"""[m] Position and target of the camera for a path in front of the arm."""

CLOSING = ": close"
"""Suffix of the name of the task that closes the fingers on an object."""

EMPTYING = 0.45
"""[1] Fraction of the pouring motion at which the cup pours."""

DESIRED_RADIUS, TRACED_RADIUS = 1.2e-3, 2e-3
"""[m] Radii of the tubes of the desired and the traced path."""


def moments(run: Simulation) -> dict[str, int]:
    """Return the tick of each picture by its name, for the moments that the run has."""
    # Tasks of alternatives that were not taken are left out.
    executed, tasks = sorted(set(run.tasks.tolist())), run.program.tasks
    names = {number: tasks[number].name for number in executed}
    takes = [number for number, name in names.items() if name.endswith(CLOSING)]
    pours = [number for number, name in names.items() if name == POURING]
    ticks_by_name: dict[str, int] = {}
    if takes:
        step = tasks[takes[0]].number
        start = next(number for number in executed if tasks[number].number == step)
        ticks_by_name["initial"] = _ticks(run, start)[0]
        ticks_by_name["grasping"] = _ticks(run, takes[0])[-1]
    if pours:
        ticks = _ticks(run, pours[0])
        ticks_by_name["approaching"] = ticks[0]
        ticks_by_name["emptying"] = ticks[int(EMPTYING * (len(ticks) - 1))]
    if not ticks_by_name:
        drawn = [tick for tick, state in enumerate(run.states) if path_of(state) is not None]
        if drawn:
            ticks_by_name["tracing"] = drawn[int(DONE * (len(drawn) - 1))]
    return ticks_by_name


DONE = 0.7
"""[1] Fraction of a path at which the arm is shown."""


def stage_pictures(run: Simulation, robot: Robot, props: Props) -> Mapping[str, bytes]:
    """Return the PNG files by their names."""
    stage, states = RenderStage(robot, run.session, props), run.states
    pictures: dict[str, bytes] = {}
    ticks = moments(run)
    on_object = ON_TABLE if "grasping" not in ticks else _look(robot, states[ticks["grasping"]])
    for name, tick in ticks.items():
        state, items = states[tick], stage.items(states[tick])
        look = on_object
        if name == "tracing":
            items += _lines(robot, states[: tick + 1])
            look = ON_PATH
        camera = Camera(*look, FOV, SIZE)
        pictures[f"{name}.png"] = png(picture(items, stage.water(state), camera))
    return pictures


Look = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Position and target of a camera [m]."""


def _look(robot: Robot, state: State) -> Look:
    """Return the look at an object that the arm grasps in ``state``."""
    if robot.require_arm().kinematics.is_pitched:
        return ON_TABLE
    view = camera_pose(Preset.FREE, robot, state)
    return view.position, view.target


def _ticks(run: Simulation, task: int) -> list[int]:
    return [int(tick) for tick in np.flatnonzero(run.tasks == task)]


def _lines(robot: Robot, states: Sequence[State]) -> list[Item]:
    """Return tubes of the path of the last state and of its traced part, coloured by the error."""
    path = path_of(states[-1])
    assert path is not None
    T = robot.require_arm().T_base_shoulder

    def seen(points: FloatArray) -> FloatArray:
        return np.asarray(points @ T[:3, :3].T + T[:3, 3])

    whole = point_derivatives(path, np.linspace(0.0, 1.0, PATH_SAMPLES + 1))[0]
    on_path = [state for state in states if path_of(state) is path]
    traced = np.array([forward(path.chain, state.setpoint)[:3, 3] for state in on_path])
    worst = commanded_errors(path, on_path).max()
    red, green, blue = coloured(np.array([worst]))[0].tolist()
    tubes = (
        tube("desired path", seen(whole), DESIRED_RADIUS, DESIRED),
        tube("traced path", seen(traced), TRACED_RADIUS, (red, green, blue)),
    )
    return [item for item in tubes if item is not None]
