"""The score of a recording, and ``katana450 score``, which compares several.

It has the measures of a report, smoothness, and what happened.
"""

from __future__ import annotations

import json
import math
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import Reason, State
from katana450.assembly.log_output import printable
from katana450.assembly.robot_session import DescribedRobot
from katana450.errors import InputError
from katana450.extensions.programs.script.measures import MEASURES as REPORTED
from katana450.extensions.programs.script.measures import (
    OF_A_MEASURED_ARM,
    MeasuredRun,
    motion_measures,
    run_errors,
    title_of,
    unit_of,
    water_measures,
)
from katana450.extensions.programs.steps.trajectory import CubicSpline
from katana450.extensions.recording.episodes.episode_folder import shown_part
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import (
    check_whole,
    session_for,
    simulated_states,
)
from katana450.extensions.recording.files.table import columns
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.engine import Contact
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch

RATE = 100.0
"""[Hz] Rate of the samples."""

WINDOW, DEGREE = 7, 3
"""Samples and degree of the polynomials that are fitted for derivatives of the velocity."""

CUTOFF, AMPLITUDE, PADDING = 10.0, 0.05, 4
"""Highest frequency [Hz], smallest amplitude [1] and padding [powers of 2] of the spectrum."""


def sparc(speed: FloatArray) -> float:
    """Return the spectral arc length of ``speed`` (N,) [m/s], sampled at RATE; 0 is perfect.

    It is the negative length of the normalised magnitude spectrum of the speed, up to CUTOFF and
    to the last frequency with at least AMPLITUDE of the largest one. A motion with one bell-shaped
    rise and fall of its speed has about -1.41; every stop in between makes it more negative.

    Source: Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet, On the analysis of movement
    smoothness, Journal of NeuroEngineering and Rehabilitation 12:112 (2015).
    """
    count = 2 ** (int(np.ceil(np.log2(max(len(speed), 2)))) + PADDING)
    magnitude = np.abs(np.fft.fft(speed, count))
    magnitude = magnitude / magnitude.max()
    frequency = np.arange(count) * RATE / count
    low = frequency <= CUTOFF
    frequency, magnitude = frequency[low], magnitude[low]
    last = int(np.flatnonzero(magnitude >= AMPLITUDE)[-1])
    if last == 0:
        return 0.0
    across = np.diff(frequency[: last + 1]) / frequency[last]
    return -float(np.hypot(across, np.diff(magnitude[: last + 1])).sum())


def dimensionless_jerk(velocity: FloatArray) -> float:
    """Return the mean squared jerk of ``velocity`` (N, 3) [m/s], sampled at RATE, as a number.

    It is the integral of the squared jerk times T^5 / L^2, with the time T and the length L of the
    path. The smoothest motion from rest to rest on a line, of minimum jerk, has 720; each stop in
    between and each tremor increases it. Derivatives are those of polynomials fitted to WINDOW
    samples (Savitzky and Golay, Analytical Chemistry 36:1627, 1964), at both ends those of the
    first and the last polynomial, so that a part that begins in motion has no step there.

    Args:
        velocity: at least WINDOW samples.

    Source: Hogan and Sternad, Sensitivity of smoothness measures to movement duration, amplitude,
    and arrests, Journal of Motor Behavior 41:529 (2009).
    """
    half = WINDOW // 2
    times = np.arange(-half, half + 1) / RATE
    fit = np.linalg.pinv(times[:, None] ** np.arange(DEGREE + 1))
    inner = [np.convolve(column, 2.0 * fit[2][::-1], "valid") for column in velocity.T]
    second = 2.0 * fit[2] + 6.0 * times[:, None] * fit[3]
    begin, end = second[:half] @ velocity[:WINDOW], second[-half:] @ velocity[-WINDOW:]
    jerk = np.concatenate((begin, np.stack(inner, axis=1), end))
    duration = (len(velocity) - 1) / RATE
    length = float(np.linalg.norm(velocity, axis=1).sum()) / RATE
    return float((jerk * jerk).sum()) / RATE * duration**5 / length**2


MEASURES: Final = (
    "duration_s",
    "tool_path_mm",
    "dimensionless_jerk",
    "sparc",
    "nearest_clearance_mm",
    "margin_to_limits_deg",
    "smallest_singular_value",
    "max_speed_fraction",
    "max_tool_speed_mm_s",
    "executed_position_error_mm",
    *(name for name in REPORTED if name in OF_A_MEASURED_ARM),
    "emptied_ml",
    "emptied_percent",
    "spilled_ml",
    "cup_peak_jerk_m_s3",
    "stops",
    "contacts",
)
"""Name of each measure, with its unit at the end; docs/recording.md defines them."""

CLEARANCE_PERIOD = 0.05
"""[s] Period of the clearance samples."""

SAME_SETPOINT = 1e-6
"""[rad] Largest difference of the simulation from the recorded setpoints."""


@dataclass(frozen=True, eq=False)
class Scored:
    """The score of a part of a recording.

    Attributes:
        name: name of the recording.
        values: each of MEASURES by its name; None if it does not apply.
    """

    name: str
    values: Mapping[str, float | None]

    def __repr__(self) -> str:
        known = {name: value for name, value in self.values.items() if value is not None}
        shown = ", ".join(f"{name}={value:.4g}" for name, value in known.items())
        return f"Scored({self.name!r}, {shown})"


def scored(
    file: RecordingFile,
    robot: DescribedRobot,
    start: float = 0.0,
    end: float = math.inf,
    *,
    name: str = "recording",
) -> Scored:
    """Return the score of ``file`` from ``start`` to ``end`` [s] after its start.

    The recorded commands are simulated again, so that every state is complete.

    Args:
        file: the recording.
        robot: the recorded robot and its rules.
        start: start of the part [s].
        end: end of the part [s].
        name: name of the recording.

    Raises:
        InputError: the part has no motion or a gap, or the simulation differs from the recording.
    """
    first, last = file.start + start, min(file.start + end, file.end)
    check_whole(file, first, last)
    session = robot.session
    states = list(simulated_states(file, session, first, last))
    # The last one before the part is its first.
    states = states[max(sum(state.t <= first for state in states) - 1, 0) :]
    _check_same(file, states, first, last)
    moving = _moving(states)
    if moving is None:
        raise InputError(f"Nothing moves in this part of {file.path}.")
    begin, stop = moving
    # An arm at rest makes no ticks, so the state before the first motion may be much older.
    first_t = max(states[begin].t, states[begin + 1].t - 1.0 / RATE)
    run = [replace(states[begin], t=first_t), *states[begin + 1 : stop + 1]]
    tool = _tool_points(robot, run)
    velocity = np.gradient(tool, 1.0 / RATE, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    arm = session.require_arm()
    joints = motion_measures(
        arm,
        [state.tool for state in run],
        np.array([state.setpoint for state in run]),
        np.array([state.motion.qd for state in run]),
    )
    moved = float(speed.max()) > 0.0 and len(speed) >= WINDOW
    values: dict[str, float | None] = dict.fromkeys(MEASURES)
    values |= {
        "duration_s": run[-1].t - run[0].t,
        "tool_path_mm": 1e3 * float(np.linalg.norm(np.diff(tool, axis=0), axis=1).sum()),
        "dimensionless_jerk": dimensionless_jerk(velocity) if moved else None,
        "sparc": sparc(speed) if moved else None,
        "nearest_clearance_mm": _clearance(session, run),
        **joints,
        "stops": float(_begins([state.stopped is not None for state in states])),
        "contacts": float(_begins([_waits_before_contact(state) for state in states])),
    }
    errors = run_errors(run)
    values["executed_position_error_mm"] = 1e3 * float(errors.max()) if errors.size else None
    measured = MeasuredRun.of(arm, run)
    if measured is not None:
        values |= measured.values
    water = states[-1].poured
    if water is not None and water.water.total:
        values |= water_measures(water.water, water.course)
    return Scored(name, values)


def _check_same(file: RecordingFile, states: Sequence[State], first: float, last: float) -> None:
    """Raise InputError unless the simulation has the recorded setpoints."""
    if not states:
        raise InputError(f"{file.path} has no complete state in this part.")
    recorded = columns(file, first, last)
    t = np.array([state.t for state in states])
    number = np.clip(np.searchsorted(t, recorded["t"], side="right") - 1, 0, len(t) - 1)
    # Of several states at one time the file may have any.
    same = (t[number] == recorded["t"]) & (np.diff(recorded["t"], append=math.inf) > 0.0)
    simulated = np.array([state.setpoint for state in states])[number[same]]
    off = np.abs(simulated - recorded["setpoint"][same]).max(initial=0.0)
    if not off <= SAME_SETPOINT:
        raise InputError(
            f"The simulation of {file.path} differs from the recording by {off:.2g} rad, so it "
            "cannot be scored. `katana450 record verify` tells where it was made."
        )


def _moving(states: Sequence[State]) -> tuple[int, int] | None:
    """Return the states before the first motion and after the last; None if nothing moves."""
    q = np.array([(*state.setpoint, state.gripper_setpoint) for state in states])
    moved = np.flatnonzero(np.abs(np.diff(q, axis=0)).max(axis=1) > 0.0)
    return (int(moved[0]), int(moved[-1]) + 1) if len(moved) else None


def _tool_points(robot: DescribedRobot, states: Sequence[State]) -> FloatArray:
    """Return the points (N, 3) [m] of the default tool in the base frame, at the RATE."""
    arm = robot.session.require_arm()
    points = forward_batch(arm.chain, np.array([state.setpoint for state in states]))[:, :3, 3]
    times = np.array([state.t for state in states])
    later = np.concatenate(([True], np.diff(times) > 0.0))
    times, points = times[later] - times[0], points[later]
    # An arm at rest makes no ticks; without points in such a gap the spline would swing there.
    gaps = np.flatnonzero(np.diff(times) > 2.5 / RATE)
    step = 1.0 / RATE
    rests = [np.arange(times[n] + step, times[n + 1] - 0.5 * step, step) for n in gaps]
    held = np.concatenate([np.empty(0), *rests])
    numbers = np.searchsorted(times, held, side="right") - 1
    order = np.argsort(np.concatenate((times, held)), kind="stable")
    times = np.concatenate((times, held))[order]
    points = np.concatenate((points, points[numbers]))[order]
    t = np.arange(0.0, times[-1] + 0.5 / RATE, 1.0 / RATE)
    positions = CubicSpline(times, points).values_at(np.minimum(t, times[-1]))
    T = robot.robot.require_arm().T_base_shoulder
    return np.asarray(positions @ T[:3, :3].T + T[:3, 3])


def _clearance(session: Session, states: Sequence[State]) -> float | None:
    """Return the minimum clearance [mm]; None where nothing can meet."""
    nearest: float | None = None
    due = -math.inf
    for state in states:
        if state.t < due:
            continue
        due = state.t + CLEARANCE_PERIOD
        world = session.world_at(state)
        contact = None if world is None else world.nearest(state.x_setpoint)
        if contact is None or (contact.distance < MIN_CLEARANCE and _of_held(state, contact)):
            continue
        nearest = contact.distance if nearest is None else min(nearest, contact.distance)
    return None if nearest is None else 1e3 * nearest


def _of_held(state: State, contact: Contact) -> bool:
    """Return whether an object takes part that fingers may touch, as when it is grasped."""
    return any(body.can_be_held and body.name in contact.parts for body in state.objects)


def _waits_before_contact(state: State) -> bool:
    return state.blocked or any(finding.reason is Reason.CONTACT for finding in state.findings)


def _begins(flags: Sequence[bool]) -> int:
    """Return how often ``flags`` become true."""
    return sum(now and not before for before, now in zip((False, *flags), flags, strict=False))


DIGITS = 4
"""Significant digits of a value."""


def table_of(scores: Sequence[Scored]) -> list[str]:
    """Return a line for each measure that applies, with a column for each of ``scores``."""
    table = [["", *(score.name for score in scores)]]
    for measure in MEASURES:
        if all(score.values[measure] is None for score in scores):
            continue
        name = "SPARC" if measure == "sparc" else title_of(measure)
        cells = [shown(score.values[measure]) for score in scores]
        table.append([f"{name} {unit_of(measure)}".rstrip(), *cells])
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join((row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:]))).rstrip()
        for row in table
    ]


def shown(value: float | None) -> str:
    """Return ``value`` with DIGITS significant digits; a dash for None."""
    if value is None:
        return "–"
    if value != 0.0 and (abs(value) < 1e-3 or abs(value) >= 1e5):
        return f"{value:.2e}".replace("e+0", "e").replace("e-0", "e-")
    digits = DIGITS - 1 - (math.floor(math.log10(abs(value))) if value else 0)
    text = f"{value:.{max(digits, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def score_files(options: Namespace) -> int:
    """Run ``katana450 score`` and return the exit status. Raises InputError."""
    scores = [score_file(path, options.start, options.end, options.urdf) for path in options.files]
    # The fastest first; a score without a motion does not exist.
    scores.sort(key=lambda score: score.values["duration_s"] or 0.0)
    if options.json:
        print(json.dumps([{"name": score.name, **score.values} for score in scores], indent=2))
        return 0
    for line in table_of(scores):
        print(printable(line))
    return 0


def score_file(
    path: Path,
    start: float | None = None,
    end: float | None = None,
    urdf: Path | None = None,
) -> Scored:
    """Return the score of the recording at ``path``.

    Args:
        path: file of the recording.
        start: [s] start of the part that counts; None: as ``shown_part`` says.
        end: [s] its end; None: as ``shown_part`` says.
        urdf: file of the recorded robot, if it is not that of this program.

    Raises InputError.
    """
    with RecordingFile.open(path) as file:
        robot = session_for(file, urdf)
        return scored(file, robot, *shown_part(file, start, end), name=path.name)
