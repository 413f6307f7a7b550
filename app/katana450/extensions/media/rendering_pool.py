"""Pictures of many states, rendered by all cores."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.state import State
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import find_robot
from katana450.extensions.media.picture import Picture, picture
from katana450.extensions.media.scene import Camera
from katana450.extensions.media.stage import RenderStage
from katana450.server.view.cameras import camera_pose
from katana450.server.viser_bridge.presets import FOV, Preset
from katana450.settings import Settings

Pixels = npt.NDArray[np.uint8]

AHEAD = 4
"""Number of states for each process that are rendered or wait, so that memory stays bounded."""


class Shot(NamedTuple):
    """The view and size of a picture."""

    preset: Preset
    size: tuple[int, int]

    def taken(self, stage: RenderStage, robot: Robot, state: State) -> Picture:
        """Return the picture of ``state``."""
        view = camera_pose(self.preset, robot, state)
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
            waiting.append(pool.submit(_take, _reduced(state)))
            if len(waiting) >= AHEAD * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()

    try:
        yield pictures
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _reduced(state: State) -> State:
    """Return ``state`` without invisible parts, to transfer less to other processes."""
    return replace(state, mode=IDLE, findings=())


class _Studio(NamedTuple):
    """The data of a process that renders pictures."""

    shots: tuple[Shot, ...]
    robot: Robot
    stage: RenderStage


_studios: list[_Studio] = []
"""The only entry is set in processes that render pictures."""


def _begin(shots: tuple[Shot, ...], urdf: Path, bare: bool) -> None:
    # Ctrl-C is handled by the process that writes the file.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Processes of a pool would wait for ever for work of a parent that was killed.
    threading.Thread(target=_end_with_parent, daemon=True).start()
    session: Session
    robot, session, _ = find_robot(replace(Settings(), bare=bare), urdf, None)
    _studios.append(_Studio(shots, robot, RenderStage(robot, session, load_props())))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _take(state: State) -> tuple[Pixels, ...]:
    (studio,) = _studios
    stage, robot = studio.stage, studio.robot
    return tuple(shot.taken(stage, robot, state).pixels for shot in studio.shots)
