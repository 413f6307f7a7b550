"""States as pictures: the arm, the scene objects and the water as shapes, rendered by all cores."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from multiprocessing.connection import wait
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.arm.robot.props import Props, load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material, VisualMesh, shapes_of, smooth_normals
from katana450.arm.robot.visual import Visual
from katana450.assembly.robot_session import find_robot
from katana450.caching import cached_property
from katana450.extensions.conduit import ConduitStretch, poses, ring, stretches_of
from katana450.extensions.media.picture import (
    Camera,
    Item,
    Pixels,
    Translucent,
    check_traceable,
    picture,
)
from katana450.extensions.media.wrist_camera import WRIST, WristCamera
from katana450.extensions.water import WaterPart, parts_of
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.water.surface import COLOUR
from katana450.server.view.cameras import camera_pose
from katana450.server.view.scene_objects import COLOUR as PLAIN_COLOUR
from katana450.server.view.scene_objects import form
from katana450.server.viser_bridge.presets import FOV, Preset
from katana450.settings import Settings

RED, GREEN, BLUE = COLOUR
MATERIAL = Material("water", (RED / 255.0, GREEN / 255.0, BLUE / 255.0))
"""Material of all water."""


def _translucent(part: WaterPart) -> Translucent:
    faces = part.faces.astype(np.int64)
    shape = VisualMesh(MATERIAL, part.corners, smooth_normals(part.corners, faces), faces)
    return Translucent(Item(shape, np.eye(4)), part.opacity)


class RenderStage:
    """Shapes that are read once, and placed for each state."""

    def __init__(self, robot: Robot, session: Session, props: Props) -> None:
        """Read the shapes. ``session`` gives the poses of objects and water."""
        self._robot = robot
        self._session = session
        self._links = {link.name: link.shapes for link in robot.links}
        self._table = _in_file(props.table.mesh)
        self._props = props
        self._stretches = [_BendableStretch(stretch) for stretch in stretches_of(robot)]

    @cached_property
    def wrist_camera(self) -> WristCamera:
        """The camera on the hand. Raises InputError without one."""
        return WristCamera(self._robot, self._session)

    def items(self, state: State) -> list[Item]:
        """Return all opaque items."""
        return [*self.arm(state), *self.conduit(state), *self.surrounding_items(state)]

    def arm(self, state: State) -> list[Item]:
        """Return the items of the links."""
        frames = self._frames(state)
        return [
            Item(shape, frames[name]) for name, shapes in self._links.items() for shape in shapes
        ]

    def conduit(self, state: State) -> list[Item]:
        """Return the items of the conduit."""
        frames, angles = self._frames(state), self._angles(state)
        return [
            Item(
                bendable.bent(angles[bendable.stretch.joint.name]),
                frames[bendable.stretch.start.link],
            )
            for bendable in self._stretches
        ]

    def surrounding_items(self, state: State) -> list[Item]:
        """Return the items of the table and the scene objects."""
        x = state.x
        items = [Item(shape, np.eye(4)) for shape in self._table]
        for scene_object in state.objects:
            if scene_object.appearance.hidden or scene_object.is_zone:
                continue
            T = self._session.environment.pose(scene_object, x)
            items += [Item(shape, T) for shape in self._shapes(scene_object)]
        return items

    def _shapes(self, scene_object: SceneObject) -> Sequence[VisualMesh]:
        prop = self._props.file_of(scene_object)
        return (_plain(scene_object),) if prop is None else _in_file(*prop)

    def water(self, state: State) -> list[Translucent]:
        """Return the items of the water; none without water."""
        pouring = self._session.pouring
        if pouring is None or state.poured is None:
            return []
        water_environment = pouring.water_environment(state.objects)
        return [_translucent(part) for part in parts_of(state.poured.water, water_environment)]

    def _angles(self, state: State) -> Mapping[str, float]:
        return self._robot.joint_values(state.q, state.gripper)

    def _frames(self, state: State) -> Mapping[str, FloatArray]:
        """Return the pose (4, 4) of each link in the base frame."""
        return self._robot.frames(self._angles(state))


class _BendableStretch:
    """The rings of a stretch of conduit, as on the page."""

    def __init__(self, stretch: ConduitStretch) -> None:
        self.stretch = stretch
        self._vertices, self._faces = ring(stretch.radius)
        self._normals = smooth_normals(self._vertices, self._faces)

    def bent(self, angle: float) -> VisualMesh:
        """Return its mesh for the joint at ``angle`` [rad], in the frame of its first link."""
        rings = np.asarray(poses(self.stretch, angle), dtype=float)
        R = np.array([so3.from_quaternion(pose) for pose in rings[:, :4]])
        vertices = np.einsum("rij,vj->rvi", R, self._vertices) + rings[:, None, 4:]
        normals = np.einsum("rij,vj->rvi", R, self._normals)
        faces = self._faces + len(self._vertices) * np.arange(len(rings))[:, None, None]
        return VisualMesh(
            HOSE,
            frozen(vertices.reshape(-1, 3)),
            frozen(normals.reshape(-1, 3)),
            faces.reshape(-1, 3).astype(np.int64),
        )


HOSE = Material("rubber", (0.035, 0.035, 0.04))
"""Material of the conduit."""


@lru_cache
def _in_file(
    path: Path, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> Sequence[VisualMesh]:
    return tuple(shapes_of(Visual(frozen(np.eye(4)), frozen(np.array(scale)), path)))


def _plain(scene_object: SceneObject) -> VisualMesh:
    red, green, blue = scene_object.appearance.colour or PLAIN_COLOUR
    colour = red / 255.0, green / 255.0, blue / 255.0
    visual = Visual(
        frozen(np.eye(4)), frozen(np.ones(3)), None, PLAIN_COLOUR, make=lambda: form(scene_object)
    )
    (shape,) = shapes_of(visual)
    return VisualMesh(Material("plain", colour), shape.vertices, shape.normals, shape.faces)


AHEAD = 4
"""Number of states for each process that are rendered or wait, so that memory stays bounded."""


class Shot(NamedTuple):
    """The view and size of a picture. The view has the name of a preset, or is "wrist"."""

    view: str
    size: tuple[int, int]

    def taken(self, stage: RenderStage, robot: Robot, state: State) -> Pixels:
        """Return the picture of ``state``. Raises InputError for a wrist without a hand."""
        if self.view == WRIST:
            camera = stage.wrist_camera.of(state, self.size)
        else:
            view = camera_pose(Preset[self.view.upper()], robot, state)
            camera = Camera(view.position, view.target, float(FOV), self.size)
        return picture(stage.items(state), stage.water(state), camera)


Pictures = Callable[[Iterable[State]], Iterator[tuple[Pixels, ...]]]
"""A function that yields the pictures of each of some states, in their order."""


@contextmanager
def rendering_pool(shots: Sequence[Shot], urdf: Path, bare: bool, count: int) -> Iterator[Pictures]:
    """Yield the function that renders ``shots`` of states, in processes that end with the context.

    They start with the first picture.

    Args:
        shots: the pictures of each state.
        urdf: file of the robot.
        bare: whether it has no gripper.
        count: number of states.
    """
    workers = max(min(os.cpu_count() or 1, count), 1)
    # Pictures are independent, so each is rendered on one core.
    pool = ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), _begin, (tuple(shots), urdf, bare)
    )

    def pictures(states: Iterable[State]) -> Iterator[tuple[Pixels, ...]]:
        waiting: deque[Future[tuple[Pixels, ...]]] = deque()
        for state in states:
            waiting.append(pool.submit(_take, state))
            if len(waiting) >= AHEAD * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()

    try:
        yield pictures
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


class Studio(NamedTuple):
    """A robot, its stage, and the pictures of it that a process renders."""

    shots: tuple[Shot, ...]
    robot: Robot
    stage: RenderStage

    @staticmethod
    def of(
        shots: Iterable[tuple[str, tuple[int, int]]],
        settings: Settings,
        urdf: Path,
        tool: str | None,
    ) -> Studio:
        """Return the studio of the robot in the file ``urdf``."""
        check_traceable()
        robot, session, _ = find_robot(settings, urdf, tool)
        stage = RenderStage(robot, session, load_props())
        return Studio(tuple(Shot(*shot) for shot in shots), robot, stage)

    def taken(self, state: State) -> tuple[Pixels, ...]:
        """Return the picture of each shot. Raises InputError for a wrist without a hand."""
        return tuple(shot.taken(self.stage, self.robot, state) for shot in self.shots)


_studios: list[Studio] = []
"""The only entry is set in processes that render pictures."""


def _begin(shots: tuple[Shot, ...], urdf: Path, bare: bool) -> None:
    # Ctrl-C is handled by the process that writes the file.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Processes of a pool would wait for ever for work of a parent that was killed.
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _studios.append(Studio.of(shots, replace(Settings(), bare=bare), urdf, None))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _take(state: State) -> tuple[Pixels, ...]:
    (studio,) = _studios
    return studio.taken(state)
