"""``katana450 record again``: a recorded part as a motion, and the script that runs it again."""

from __future__ import annotations

import math
import tempfile
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml

from katana450.arm.control.arm import ArmModel, GripperModel
from katana450.arm.control.state.state import Status
from katana450.assembly.robot_session import DescribedRobot
from katana450.atomic import write_files, writer_of
from katana450.cli.main import main
from katana450.client import Client, connect
from katana450.client.files import LostError
from katana450.errors import InputError
from katana450.extensions.programs.language.source import MAX_BYTES, MAX_VALUES
from katana450.extensions.programs.script.script import MAX_NAME_LENGTH, MAX_STEPS
from katana450.extensions.programs.steps.trajectory import MAX_POSTURES, TRAJECTORY, CubicSpline
from katana450.extensions.recording.episodes.episode_folder import shown_part
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import check_whole, session_for
from katana450.extensions.recording.files.table import rows_from
from katana450.extensions.recording.messages import StateRow
from katana450.maths.geometry.arrays import FloatArray, IntArray, finite_array
from katana450.server.api import answers

WAITING = (Status.PAUSED.value, Status.STOPPED.value)
"""Statuses of an arm that somebody has paused or stopped."""

MIN_STEP = 5e-3
"""[s] Minimum time between two states that are used; an extra tick for a STOP comes sooner."""

MIN_GAP, TICK = 0.03, 0.01
"""[s] Time between two states from which on the arm rested between them, and period of ticks."""


@dataclass(frozen=True, eq=False)
class RecordedPart:
    """The N states of a part of a recording.

    Attributes:
        t: (N,) times since the start of the recording [s], rising.
        setpoint: (N, 5) setpoints of the joints [rad].
        fingers: (N,) setpoint of the finger joint [rad or m].
        waiting: (N,) whether the arm was paused or stopped from this state on.
        held: (N,) name of the object between the fingers; "" for none.
        tools: (N,) the tool frame.
        name: name of the file.
    """

    t: FloatArray
    setpoint: FloatArray
    fingers: FloatArray
    waiting: npt.NDArray[np.bool_]
    held: tuple[str, ...]
    tools: tuple[str, ...]
    name: str

    @property
    def rests(self) -> npt.NDArray[np.bool_]:
        """Flags (N - 1,) of the states from which on nothing moves until the next one."""
        moved = np.abs(np.diff(self.setpoint, axis=0)).max(axis=1) > 0.0
        return np.asarray(~(moved | (np.diff(self.fingers) != 0.0)))

    @property
    def duration(self) -> float:
        """The time from the first motion to the end of the last, without pauses and stops [s]."""
        moving = np.flatnonzero(~self.rests)
        if not len(moving):
            return 0.0
        first, last = int(moving[0]), int(moving[-1]) + 1
        lasted = np.diff(self.t)[first:last]
        left_out = (self.rests & self.waiting[:-1])[first:last]
        return float(lasted[~left_out].sum())


def read_part(
    file: RecordingFile, start: float = 0.0, end: float = math.inf, *, name: str = "recording"
) -> RecordedPart:
    """Return the part of ``file`` from ``start`` to ``end`` [s] after its start.

    Raises InputError for a robot without a tool, a part without motion or with a gap, and a damaged
    file.
    """
    first, last = file.start + start, min(file.start + end, file.end)
    if first >= last:
        raise InputError(
            f"{file.path} is {file.end - file.start:.2f} s long; a part from {start:g} s to "
            f"{end:g} s has nothing of it."
        )
    check_whole(file, first, last)
    states = list(rows_from(file, first, last))
    if not states or states[0].position is None:
        raise InputError(f"{file.path} is not a recording of an arm with a tool.")
    part = _part(file, states, name)
    if bool(part.rests.all()):
        raise InputError(f"Nothing moves in this part of {file.path}.")
    return part


def _part(file: RecordingFile, states: list[StateRow], name: str) -> RecordedPart:
    count = len(states)
    t = np.array([row.t for row in states])
    shape = count, len(states[0].setpoint)
    setpoint = finite_array([row.setpoint for row in states], shape, f"setpoint of {file.path}")
    fingers = np.array([row.gripper_setpoint for row in states])
    waiting = np.array([row.status in WAITING for row in states])
    held, tools = tuple(_held(states)), tuple(row.tool for row in states)
    # The last of several states at nearly one time is kept, and always the first one.
    mask = np.append(np.diff(t) >= MIN_STEP, True)
    mask[0] = True
    if count > 1 and t[np.flatnonzero(mask)[1]] - t[0] < MIN_STEP:
        mask[np.flatnonzero(mask)[1]] = False
    t, numbers = _with_rests(t[mask], np.flatnonzero(mask))
    return RecordedPart(
        t - file.start,
        setpoint[numbers],
        fingers[numbers],
        waiting[numbers],
        tuple(held[number] for number in numbers.tolist()),
        tuple(tools[number] for number in numbers.tolist()),
        name,
    )


def _with_rests(t: FloatArray, numbers: IntArray) -> tuple[FloatArray, IntArray]:
    """Return ``t`` and ``numbers`` (N,) with the end of each rest added.

    An arm at rest writes no states, so the state before a gap lasts until one tick before its end.
    """
    before = np.flatnonzero(np.diff(t) > MIN_GAP)
    return (
        np.insert(t, before + 1, t[before + 1] - TICK),
        np.insert(numbers, before + 1, numbers[before]),
    )


def _held(states: list[StateRow]) -> Iterator[str]:
    """Yield the name of the object that the fingers hold in each state; "" for none."""
    held = ""
    for row in states:
        for pose in row.objects:
            if pose.held:
                held = pose.name
            elif pose.name == held:
                held = ""
        if held in row.removed:
            held = ""
        yield held


TOLERANCES = (1e-4, 3e-4, 1e-3)
"""[rad] Largest distances of the trajectory from the recorded setpoints; a larger one if the script
would be too long."""

REST_FRACTION, REST_TOLERANCE = 0.05, 2e-6
"""[1], [rad] Near the ends of a motion the distance is at most this fraction of what is moved, plus
a rounding: an object that leaves the table by micrometres must not dip into it."""

MIN_REST = 0.1
"""[s] Shorter rests belong to the motion."""

MIN_MOTION = 1e-5
"""[rad] Smaller motions are left out; the next one then begins where the last one ended."""

FINGER_REST = 0.3
"""[s] Motions of the fingers with a shorter rest between are one."""

FIRST_SPACING = 0.2
"""[s] Time between postures before more are added."""

TIME_DIGITS, ANGLE_DIGITS, EXACT_DIGITS = 5, 6, 8
"""Decimals of times [s] and angles [deg] in a trajectory, and of single numbers."""

EVENTS_OF_ROW = 3
"""YAML events of a posture, beside those of its angles."""


class Motion(NamedTuple):
    """The arm moves from the state ``first`` to the state ``last``."""

    first: int
    last: int


Step = dict[str, Any]
"""A step as a script has it."""


def again_script(part: RecordedPart, gripper: GripperModel, *, bare: bool = False) -> str:
    """Return the script that moves to the start of ``part`` and then as recorded.

    Rests are kept, except those in which the arm was paused or stopped. Where the fingers moved
    while the arm did, the arm rests meanwhile.

    Args:
        part: the recorded motion.
        gripper: the gripper of the arm.
        bare: whether the gripper was taken off the arm.

    Raises:
        InputError: the part begins with an object in the hand, or is too long for a script.
    """
    if part.held[0]:
        raise InputError(
            f"The hand holds {part.held[0]} at the start of this part. Begin before it is grasped, "
            "by --from."
        )
    pieces = tuple(pieces_of(part, gripper))
    of_row = EVENTS_OF_ROW + part.setpoint.shape[1]
    for tolerance in TOLERANCES:
        steps = [*_to_start(part, gripper), *_steps(part, pieces, tolerance)]
        counts = [len(step[TRAJECTORY]["through"]) for step in steps if TRAJECTORY in step]
        events = of_row * (sum(counts) + len(steps) + 5)
        text = _text(part, steps, bare=bare)
        if (
            len(text.encode()) <= MAX_BYTES
            and events <= MAX_VALUES
            and max(counts, default=0) <= MAX_POSTURES
            and len(steps) <= MAX_STEPS
        ):
            return text
    raise InputError(
        f"This part has {part.duration:.0f} s with too much motion for one script. Choose a "
        "shorter part by --from and --to."
    )


def pieces_of(part: RecordedPart, gripper: GripperModel) -> Iterator[Motion | Step]:
    """Yield motions of the arm, and steps of fingers, rests and tool frames, in their order."""
    moves = np.abs(np.diff(part.setpoint, axis=0)).max(axis=1) > 0.0
    for first, last in _runs(~moves):
        inside = first > 0 and last < len(moves)
        if inside and part.t[last] - part.t[first] < MIN_REST:
            moves[first:last] = True
    runs = _merged(part.t, list(_runs(np.diff(part.fingers) != 0.0)))
    begins = dict(runs)
    chosen = {
        number + 1: tool
        for number, (before, tool) in enumerate(pairwise(part.tools))
        if tool != before
    }
    turns = (np.flatnonzero(np.diff(moves.astype(int))) + 1).tolist()
    edges = sorted({0, len(part.t) - 1, *begins, *chosen, *turns})
    busy = 0.0
    for first, last in pairwise(edges):
        if first in chosen:
            yield {"tool": chosen[first]}
        if first in begins:
            end = begins[first]
            yield _fingers(part, end, gripper)
            busy = float(part.t[end])
        if moves[first]:
            if float(np.ptp(part.setpoint[first : last + 1], axis=0).max()) > MIN_MOTION:
                yield Motion(first, last)
        elif first > 0 and last < len(part.t) - 1:
            # Rests before the first motion and after the last are left out.
            seconds = _rest(part, first, last, busy)
            if seconds > 0.0:
                yield {"wait": round(seconds, TIME_DIGITS)}
    if len(part.t) - 1 in begins:
        yield _fingers(part, -1, gripper)


def _fingers(part: RecordedPart, number: int, gripper: GripperModel) -> Step:
    """Return the step that moves the fingers to where they are in the state ``number``."""
    if part.held[number]:
        return {"gripper": {"to": "closed", "holding": part.held[number]}}
    scale = 1e3 if gripper.slides else math.degrees(1.0)
    return {"gripper": round(scale * float(part.fingers[number]), EXACT_DIGITS)}


def _rest(part: RecordedPart, first: int, last: int, busy: float) -> float:
    """Return the time [s] of the rest from ``first`` to ``last`` that is kept.

    ``busy``: time [s] until which the fingers moved, which takes its own time.
    """
    begin = np.maximum(part.t[first:last], busy)
    lasted = np.maximum(part.t[first + 1 : last + 1] - begin, 0.0)
    return float(lasted[~part.waiting[first:last]].sum())


def _runs(flags: Any) -> Iterator[tuple[int, int]]:
    """Yield first and end of each run of True in ``flags`` (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _merged(t: FloatArray, runs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return ``runs`` with those joined that have less than FINGER_REST between them."""
    ranges: list[tuple[int, int]] = []
    for first, last in runs:
        if ranges and t[first] - t[ranges[-1][1]] < FINGER_REST:
            ranges[-1] = ranges[-1][0], last
        else:
            ranges.append((first, last))
    return ranges


def _to_start(part: RecordedPart, gripper: GripperModel) -> Iterator[Step]:
    """Yield the steps to the first state."""
    yield {"joints": _degrees(part.setpoint[0], EXACT_DIGITS)}
    if gripper.moves:
        yield _fingers(part, 0, gripper)


def _steps(
    part: RecordedPart, pieces: tuple[Motion | Step, ...], tolerance: float
) -> Iterator[Step]:
    """Yield ``pieces`` as steps, within ``tolerance`` [rad] of the setpoints."""
    end: list[float] = []
    for piece in pieces:
        if isinstance(piece, dict):
            yield piece
            continue
        t, q = (rows[piece.first : piece.last + 1] for rows in (part.t, part.setpoint))
        chosen = postures(t, q, tolerance)
        rows = [
            [round(float(time), TIME_DIGITS), *_degrees(posture, ANGLE_DIGITS)]
            for time, posture in zip(t[chosen], q[chosen], strict=True)
        ]
        # After motions that were left out, the difference is far below the tolerance.
        rows[0][1:] = end or rows[0][1:]
        end = rows[-1][1:]
        yield {TRAJECTORY: {"through": rows}}


def postures(t: FloatArray, q: FloatArray, tolerance: float) -> IntArray:
    """Return the indices of states whose natural cubic spline is near all states.

    Args:
        t: (N,) times [s], rising.
        q: (N, n) setpoints [rad].
        tolerance: maximum difference of a joint [rad]; near the first and the last state less.
    """
    count = len(t)
    moved = np.minimum(np.abs(q - q[0]), np.abs(q - q[-1])).max(axis=1)
    allowed = np.minimum(tolerance, REST_FRACTION * moved + REST_TOLERANCE)
    wanted = np.linspace(t[0], t[-1], max(math.ceil((t[-1] - t[0]) / FIRST_SPACING), 1) + 1)
    chosen = np.unique(np.append(np.minimum(np.searchsorted(t, wanted), count - 1), (0, count - 1)))
    while len(chosen) < count:
        points = CubicSpline(t[chosen], q[chosen]).values_at(t - t[0])
        excess = np.abs(points - q).max(axis=1) - allowed
        added = [
            first + 1 + int(np.argmax(excess[first + 1 : last]))
            for first, last in zip(chosen[:-1].tolist(), chosen[1:].tolist(), strict=True)
            if last > first + 1 and float(excess[first + 1 : last].max()) > 0.0
        ]
        if not added:
            break
        chosen = np.unique(np.append(chosen, added))
    return chosen


def _degrees(q: FloatArray, digits: int) -> list[float]:
    return [round(angle, digits) + 0.0 for angle in np.degrees(q).tolist()]


def _text(part: RecordedPart, steps: list[Step], *, bare: bool) -> str:
    name = "".join(letter for letter in f"Again {part.name}" if letter.isprintable())
    about = (
        f"{part.name}, {part.t[0]:.2f} to {part.t[-1]:.2f} s, run again. Times are those of the "
        "recording."
    )
    head = {"name": name[:MAX_NAME_LENGTH], "about": about, "tool": part.tools[0]}
    head |= {"gripper": "none"} if bare else {}
    text: str = yaml.safe_dump(
        head | {"steps": steps},
        sort_keys=False,
        default_flow_style=None,
        allow_unicode=True,
        width=100,
    )
    return text


SAME = 1e-9
"""[rad or m] Largest difference of the numbers of one arm."""


def again(options: Namespace) -> int:
    """Run ``katana450 record again`` and return the exit status. Raises KatanaError."""
    with RecordingFile.open(options.file) as file:
        robot = session_for(file, options.urdf)
        text = script_of_part(file, robot, options.start, options.end)
    if options.out is not None:
        write_files({options.out: writer_of(text.encode())})
        print(f"Script: {options.out}")
        return 0
    try:
        with connect(options.url, "Look", options.token) as client:
            check_same_arm(client, robot.session.require_arm(), options.file)
    except LostError:
        # `katana450 run` starts a server, or reports that there is none.
        pass
    with tempfile.TemporaryDirectory(prefix="katana450-") as folder:
        script = Path(folder) / "again.yaml"
        script.write_text(text, encoding="utf-8")
        command = ["run", str(script), "--url", options.url, "--speed", str(options.speed)]
        return main(command + (["--token", options.token] if options.token else []))


def script_of_part(
    file: RecordingFile, robot: DescribedRobot, start: float | None, end: float | None
) -> str:
    """Return the script of the part of ``file`` from ``start`` to ``end`` [s] after its start.

    None: see ``shown_part``. Raises InputError as ``read_part`` and ``again_script``.
    """
    part = read_part(file, *shown_part(file, start, end), name=file.path.name)
    return again_script(part, robot.session.require_arm().gripper, bare=file.settings.bare)


def check_same_arm(client: Client, arm: ArmModel, file: Path) -> None:
    """Raise InputError if the arm of the server is not ``arm``, that of the recording ``file``."""
    other_arm = client.query(answers.Arm)
    pairs = [(other_arm.lower, arm.chain.lower), (other_arm.upper, arm.chain.upper)]
    for one, other in (
        *((np.array(row), own) for row, own in pairs),
        *((np.array(other_arm.tools.get(name, [])), M) for name, M in arm.tools.items()),
    ):
        if one.shape != other.shape or not np.allclose(one, other, 0.0, SAME):
            raise InputError(
                f"{file} is not a recording of {other_arm.name}, the arm of the server: its joint "
                "limits or tool frames differ."
            )
