"""``katana450 render``: a picture or a film of the arm, without a browser."""

from __future__ import annotations

import argparse
import math
import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.arm.control.modes import IDLE
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import describe_robot
from katana450.atomic import check_writable, write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.export.playback import Playback, chosen
from katana450.extensions.media.camera import Camera
from katana450.extensions.media.film import check_filmable, write_film
from katana450.extensions.media.picture import MOVING, STILL, Picture, picture
from katana450.extensions.media.stage import RenderStage
from katana450.extensions.media.tracer import check_traceable
from katana450.extensions.progress import progress
from katana450.server.view.cameras import camera_pose
from katana450.server.viser_bridge.presets import FOV, Preset
from katana450.server.viser_bridge.themes import THEMES, Theme
from katana450.settings import Settings

Pixels = npt.NDArray[np.uint8]


def render(options: argparse.Namespace) -> int:
    """Write the file; print its name and size. Raises InputError."""
    path: Path = options.out
    kind = path.suffix.lower()
    moves = options.run is not None or options.trajectory is not None
    if kind not in (".png", ".mp4"):
        raise InputError(f"{path} must end in .png for a picture or in .mp4 for a film.")
    if kind == ".mp4" and not moves:
        raise InputError("A film needs a motion. Use --run or --trajectory.")
    if options.at is not None and (kind == ".mp4" or not moves):
        raise InputError(
            "--at needs a picture of a motion. Use a .png file with --run or --trajectory."
        )
    if options.at is not None and not 0.0 <= options.at < math.inf:
        raise InputError(f"--at must be a time of at least 0 s, not {options.at:g}.")
    check_traceable()
    check_writable(path)
    if kind == ".mp4":
        check_filmable(options.size, options.fps)
    shot = _Shot(Preset[options.camera.upper()], options.size, options.theme.title())
    shown = chosen(options.run, options.trajectory, options.pose, options.urdf)
    if kind == ".png":
        state = shown.at(shown.duration if options.at is None else options.at)
        stage = RenderStage(shown.robot, shown.session, load_props())
        taken = shot.taken(stage, shown.robot, state, STILL)
        write_files({path: writer_of(taken.png)})
    else:
        _film(path, shown, shot, options.fps, options.urdf)
    print(f"{path}: {path.stat().st_size} bytes")
    return 0


class _Shot(NamedTuple):
    """The view and size of a picture."""

    preset: Preset
    size: tuple[int, int]
    theme: str

    def taken(self, stage: RenderStage, robot: Robot, state: State, rays: int) -> Picture:
        view = camera_pose(self.preset, robot.require_arm(), state)
        camera = Camera(view.position, view.target, float(FOV), self.size)
        theme: Theme = THEMES[self.theme]
        return picture(stage.items(state), stage.water(state), camera, theme, rays)


def _film(path: Path, shown: Playback, shot: _Shot, fps: float, urdf: Path) -> None:
    count = int(shown.duration * fps) + 1
    states = [_bare(shown.at(number / fps)) for number in range(count)]
    # Pictures are independent, so each is rendered on one core.
    pool = ProcessPoolExecutor(
        min(os.cpu_count() or 1, count),
        multiprocessing.get_context("spawn"),
        _begin,
        (shot, urdf, shown.bare),
    )
    try:
        pictures: Iterator[Pixels] = pool.map(_take, states)
        write_film(path, progress(pictures, count, path.name), shot.size, fps)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _bare(state: State) -> State:
    """Return ``state`` without invisible parts, to transfer less to other processes."""
    return replace(state, mode=IDLE, findings=())


class _Studio(NamedTuple):
    """The data of a process that renders pictures of a film."""

    shot: _Shot
    robot: Robot
    stage: RenderStage


_studios: list[_Studio] = []
"""The only entry is set in processes that render pictures of a film."""


def _begin(shot: _Shot, urdf: Path, bare: bool) -> None:
    # Ctrl-C is handled by the process that writes the file.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    session: Session
    robot, session, _ = describe_robot(replace(Settings(), bare=bare), urdf, None)
    _studios.append(_Studio(shot, robot, RenderStage(robot, session, load_props())))


def _take(state: State) -> Pixels:
    (studio,) = _studios
    return studio.shot.taken(studio.stage, studio.robot, state, MOVING).pixels
