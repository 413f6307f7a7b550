"""``katana450 record again``: drive an arm along a recorded motion, or simulate it."""

from __future__ import annotations

import tempfile
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.assembly.log_output import printable
from katana450.assembly.robot_session import DescribedRobot
from katana450.atomic import write_files, writer_of
from katana450.cli.main import main
from katana450.client import Client, RefusedError, connect
from katana450.client.files import LostError
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.planning.trajectory_path import TrajectoryPath
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.simulation import plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.recording.episodes.episode_folder import shown_part
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import at_rest, recorded_states, session_for
from katana450.extensions.recording.live.run_fetcher import fetch_run
from katana450.extensions.recording.run_again.again_script import (
    RecordedPart,
    again_script,
    read_part,
)
from katana450.maths.geometry.arrays import FloatArray, IntArray
from katana450.resources import URDF_PATH
from katana450.server.api import answers

AT_START = 1e-6
"""[rad] Distance from the recorded start at which a run counts as there."""

WINDOW = 0.05
"""[rad] How far along the path, plus that fraction of it, the corresponding place is sought."""


class PathDifference(NamedTuple):
    """The difference of two motions along the same path.

    Attributes:
        joints: largest difference of a joint at corresponding places [rad].
        duration: time of the run from the recorded start to the recorded end [s].
    """

    joints: float
    duration: float


def path_difference(recorded: FloatArray, t: FloatArray, run: FloatArray) -> PathDifference:
    """Return how far a run lies from the recorded path, at any speed and with any rests.

    Each setpoint of one motion is compared with the nearest place of the other one that is about as
    far along the path, straight between its setpoints. The larger difference of both directions
    counts. What the run does before it reaches the recorded start is left out.

    Args:
        recorded: (N, n) recorded setpoints [rad].
        t: (M,) times of the run [s].
        run: (M, n) its setpoints [rad].
    """
    away = np.abs(run - recorded[0]).max(axis=1)
    near = np.flatnonzero(away <= AT_START)
    begin = int(near[0]) if len(near) else int(np.argmin(away))
    # The last place of rest before the motion.
    while begin + 1 < len(run) and np.array_equal(run[begin + 1], run[begin]):
        begin += 1
    one, _ = _moving(recorded)
    other, kept = _moving(run[begin:])
    apart = max(_farthest(one, other), _farthest(other, one))
    return PathDifference(apart, float(t[begin + kept[-1]] - t[begin]))


def _moving(q: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the rows of ``q`` without repetitions, and their indices."""
    kept = np.flatnonzero(np.append(True, np.abs(np.diff(q, axis=0)).max(axis=1) > 0.0))
    return q[kept], kept


def _farthest(one: FloatArray, other: FloatArray) -> float:
    """Return the largest distance [rad] of a row of ``one`` from the path through ``other``."""
    if len(other) < 2:
        return float(np.abs(one - other[0]).max())
    along, path = _lengths(one), _lengths(other)
    legs = np.diff(other, axis=0)
    squared = np.maximum((legs * legs).sum(axis=1), np.finfo(float).tiny)
    reach = WINDOW + WINDOW * along
    high = np.minimum(np.searchsorted(path, along + reach) + 1, len(legs))
    low = np.clip(np.searchsorted(path, along - reach) - 1, 0, high - 1)
    farthest = 0.0
    for row, first, last in zip(one, low.tolist(), high.tolist(), strict=True):
        starts, steps = other[first:last], legs[first:last]
        fraction = ((row - starts) * steps).sum(axis=1) / squared[first:last]
        nearest = starts + np.clip(fraction, 0.0, 1.0)[:, None] * steps
        farthest = max(farthest, float(np.abs(nearest - row).max(axis=1).min()))
    return farthest


def _lengths(q: FloatArray) -> FloatArray:
    """Return the distance (N,) along ``q`` (N, n) [rad], by the joint that turns most."""
    return np.append(0.0, np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1)))


SAME = 1e-9
"""[rad or m] Largest difference of the numbers of one arm."""

SLOWER = 1.02
"""[1] Ratio of times from which a run counts as slower than recorded."""


def again(options: Namespace) -> int:
    """Run ``katana450 record again`` and return the exit status. Raises KatanaError."""
    with RecordingFile.open(options.file) as file:
        found = session_for(file, options.urdf)
        part, text = part_and_script(file, found, options.start, options.end)
        print(
            f"{options.file}: {part.duration:.2f} s of motion from {part.t[0]:.2f} s to "
            f"{part.t[-1]:.2f} s{_left_out(part)}."
        )
        if options.out is not None:
            write_files({options.out: writer_of(text.encode())})
            print(f"Script: {options.out}")
        if options.headless:
            return _simulate(options, file, found, part, text)
    return 0 if options.out is not None else _drive(options, found, part, text)


def part_and_script(
    file: RecordingFile, found: DescribedRobot, start: float | None, end: float | None
) -> tuple[RecordedPart, str]:
    """Return the part of ``file`` from ``start`` to ``end`` [s] after its start, and its script.

    None: see ``shown_part``. Raises InputError as ``read_part`` and ``again_script``.
    """
    part = read_part(file, *shown_part(file, start, end), name=file.path.name)
    return part, again_script(part, found.session.require_arm(), bare=file.settings.bare)


def _left_out(part: RecordedPart) -> str:
    return f", without {part.waited:.2f} s of pauses and stops" if part.waited else ""


def _simulate(
    options: Namespace, file: RecordingFile, found: DescribedRobot, part: RecordedPart, text: str
) -> int:
    """Simulate the script in the recorded scene, and print the result."""
    states = recorded_states(file, found.session, file.start + part.t[0], file.end)
    start = next(states, None)
    if start is None:
        raise InputError(f"{file.path} has no complete state in this part.")
    plan = plan_script(
        parse(text), options.urdf or URDF_PATH, speed=options.speed, begin=lambda _: at_rest(start)
    )
    planned, own = _times(plan.program)
    if planned > SLOWER * own:
        print(
            f"Limits of the joints and the tool make it slower: {planned:.2f} s on its "
            f"trajectories, recorded {own:.2f} s."
        )
    simulation = run_by_clock(plan)
    trace = simulation.trace
    _report(part, path_difference(part.setpoint, trace.t, trace.q))
    return 0


def _times(program: Program) -> tuple[float, float]:
    """Return the planned and the recorded time of all trajectories [s]."""
    planned = own = 0.0
    for task in program.tasks:
        if isinstance(task.action, FollowPlan):
            for segment in task.action.plan.segments:
                if isinstance(segment.path, TrajectoryPath):
                    planned += segment.scaling.span
                    own += segment.path.duration
    return planned, own


def _drive(options: Namespace, found: DescribedRobot, part: RecordedPart, text: str) -> int:
    """Run the script on the server, and print how far its setpoints lie from the recorded ones."""
    began: float | None = None
    try:
        with connect(options.url, "Look", options.token) as client:
            check_same_arm(client, found.session.require_arm(), options.file)
            began = client.query(answers.State).sent
    except LostError:
        # `katana450 run` starts a server, or reports that there is none.
        pass
    with tempfile.TemporaryDirectory(prefix="katana450-") as folder:
        script = Path(folder) / "again.yaml"
        script.write_text(text, encoding="utf-8")
        command = ["run", str(script), "--url", options.url, "--speed", str(options.speed)]
        command += ["--token", options.token] if options.token else []
        command += ["--unattended"] if options.unattended else []
        if status := main(command):
            return status
        if began is None:
            return 0
        try:
            with connect(options.url, "Look", options.token) as client:
                _report(part, driven_difference(client, part, began, Path(folder)))
        except (LostError, RefusedError) as error:
            print(f"The difference from the recorded setpoints is not known: {error}")
    return 0


def check_same_arm(client: Client, arm: ArmModel, file: Path) -> None:
    """Raise InputError if the arm of the server is not ``arm``, that of the recording ``file``."""
    there = client.query(answers.Arm)
    pairs = [(there.lower, arm.chain.lower), (there.upper, arm.chain.upper)]
    for one, other in (
        *((np.array(row), own) for row, own in pairs),
        *((np.array(there.tools.get(name, [])), M) for name, M in arm.tools.items()),
    ):
        if one.shape != other.shape or not np.allclose(one, other, 0.0, SAME):
            raise InputError(
                f"{file} is not a recording of {there.name}, the arm of the server: its joint "
                "limits or tool frames differ."
            )


def driven_difference(
    client: Client, part: RecordedPart, began: float, folder: Path
) -> PathDifference:
    """Return the difference of the run that has just ended on the server from ``part``.

    Args:
        client: a connection to the server.
        part: the recorded motion.
        began: time of the server's clock before the run [s].
        folder: folder for a temporary file.

    Raises:
        RefusedError: the server records nothing.
        LostError: the end of the run does not appear in its recording.
    """
    path = folder / "run.mcap"
    fetch_run(client, began, path)
    with RecordingFile.open(path) as file:
        run = read_part(file, max(began - file.start, 0.0))
        return path_difference(part.setpoint, run.t, run.setpoint)


def _report(part: RecordedPart, found: PathDifference) -> None:
    slower = ""
    if found.duration > SLOWER * part.duration:
        slower = " Limits, starts from rest, the fingers or pauses made it slower."
    print(
        printable(
            f"Largest difference of a joint from the recorded setpoints: {found.joints:.2g} rad. "
            f"It took {found.duration:.2f} s, recorded {part.duration:.2f} s{_left_out(part)}."
            f"{slower}"
        )
    )
