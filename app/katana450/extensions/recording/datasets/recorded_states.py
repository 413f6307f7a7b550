"""States of a recording with all their objects and water, for pictures.

The messages of states have joints and poses only. So the recorded commands are simulated, from each
complete state to the next, and the joints are those that were recorded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.recording.datasets.sampling import MAX_STEP, sampled
from katana450.extensions.recording.files.recorded_states import MOMENT, simulated_states
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import columns
from katana450.extensions.recording.messages import (
    STATE,
)
from katana450.maths.geometry.arrays import FloatArray, frozen


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
