"""States of a recording at given times, such as the frames of a dataset.

Joints are those that were recorded. The messages of states have only these and poses; for pictures,
the recorded commands are simulated, which gives all objects and water.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import MOMENT, simulated_states
from katana450.extensions.recording.files.table import columns
from katana450.extensions.recording.messages import (
    STATE,
)
from katana450.maths.geometry.arrays import FloatArray, frozen

MIN_FPS, MAX_FPS = 1, 100
"""[Hz] Range of frames per second: more than the recorded ticks would only repeat them."""

MAX_FRAMES = 10_000_000
"""Maximum number of frames of an episode, more than a day."""

TICK = 0.01
"""[s] Time between two ticks of the control loop."""

MAX_STEP = 2.5 * TICK
"""[s] Maximum time between two states of a motion; within more the arm rests."""

ROUNDING = 1e-6
"""[1] Fraction of a frame by which an episode may be too short for its last frame."""


def check_fps(fps: int) -> None:
    """Raise InputError unless a dataset can have ``fps`` frames per second."""
    if not MIN_FPS <= fps <= MAX_FPS:
        raise InputError(
            f"A dataset must have {MIN_FPS} to {MAX_FPS} frames per second, not {fps}; the arm is "
            f"recorded {MAX_FPS} times a second."
        )


def frame_times(start: float, end: float, fps: int) -> FloatArray:
    """Return the times (N,) [s] of the frames from ``start`` to ``end``, 1 / ``fps`` apart.

    Raises InputError for too many.
    """
    if (end - start) * fps > MAX_FRAMES:
        raise InputError(
            f"{end - start:.0f} s at {fps} frames per second are more than {MAX_FRAMES} frames. "
            "Choose a part, or fewer frames per second."
        )
    count = max(math.floor((end - start) * fps + ROUNDING) + 1, 0)
    return start + np.arange(count) / fps


def sampled(t: FloatArray, values: FloatArray, times: FloatArray) -> FloatArray:
    """Return the values at ``times`` (N,) [s] of states at ``t`` (M,), which do not decrease.

    Values between two ticks of a motion are interpolated. A state without a successor holds, as the
    arm rests then, until a tick before the next one. Before the first state, that one is returned.

    Args:
        t: times of the states [s].
        values: their values, (M,) or (M, n).
        times: times to sample at [s].
    """
    index = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 1)
    after = np.minimum(index + 1, len(t) - 1)
    begin, end = t[index], t[after]
    begin = np.where(end - begin > MAX_STEP, end - TICK, begin)
    length = end - begin
    fraction = np.divide(times - begin, length, out=np.zeros(len(times)), where=length > 0.0)
    fraction = np.clip(fraction, 0.0, 1.0).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[index] + fraction * (values[after] - values[index]))


def columns_from(file: RecordingFile, start: float, end: float) -> dict[str, FloatArray]:
    """Return ``columns`` of the states from ``start`` to ``end`` [s], and of the next outside.

    An arm at rest writes no states, so the state at ``start`` may be older. Raises InputError.
    """
    before = file.last_before(STATE, start)
    return columns(file, start if before is None else before.t - MOMENT, end + MAX_STEP)


class RecordedStates:
    """The states of one recording. For use in one thread."""

    def __init__(self, file: RecordingFile, session: Session) -> None:
        """Read ``file``; ``session`` has the rules of its robot."""
        self._file, self._session = file, session
        self.unknown = 0
        """Number of ticks that cannot be simulated, during which objects and water hold still."""

    def at(self, times: FloatArray) -> Iterator[State]:
        """Yield the state at each of ``times`` (N,) [s], which increase. Raises InputError."""
        if not len(times):
            return
        table = columns_from(self._file, float(times[0]), float(times[-1]))
        q = sampled(table["t"], table["q"], times)
        gripper = sampled(table["t"], table["gripper"], times)
        begin, end = float(times[0]), float(times[-1])
        states = simulated_states(self._file, self._session, begin, end, self._lose)
        known, following = None, next(states, None)
        for number, t in enumerate(times.tolist()):
            while following is not None and (known is None or following.t <= t + MOMENT):
                known, following = following, next(states, None)
            if known is None:
                raise InputError(f"{self._file.path} has no complete state before {t:.3f} s.")
            yield replace(known, q=frozen(q[number]), gripper=float(gripper[number]))

    def _lose(self, ticks: int) -> None:
        self.unknown += ticks
