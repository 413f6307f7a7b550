"""A recording of an arm as arrays: `katana450.open`."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from katana450.arm.control.commands.commands import Command
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.recording.datasets.recorded_robot import orientations
from katana450.extensions.recording.episodes.episode import Episode
from katana450.extensions.recording.episodes.episode_folder import episodes_in
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.script_runs import script_runs, sha256
from katana450.extensions.recording.files.simulation import (
    content_of,
    given_commands,
    session_for,
    simulated_state,
    verified,
)
from katana450.extensions.recording.files.table import TICK, columns
from katana450.extensions.recording.messages import EVENTS
from katana450.extensions.recording.run_again import script_of_part
from katana450.extensions.recording.ticks import Verification
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class RecordedCommand:
    """A command in a recording.

    Attributes:
        t: time of its tick [s].
        command: the command.
        giver: display name of the person or program that gave it; empty for the arm's process.
    """

    t: float
    command: Command
    giver: str


@dataclass(frozen=True)
class RecordedProgram:
    """A run of a script in a recording.

    Attributes:
        name: name of the script.
        start: time at which it began [s], maybe before the recording.
        end: time at which it ended [s]; None if it had not ended at the end of the recording.
        text: text of the script, with those of all files that it names.
    """

    name: str
    start: float
    end: float | None
    text: str


@dataclass(frozen=True, eq=False)
class Fork:
    """A simulation that continues from a moment of a recording; see ``Recording.fork``.

    Attributes:
        session: the rules of the recorded robot.
        state: all that a run continues with: joints ``q``, time ``t``, ``objects`` and more.
    """

    session: Session
    state: State

    def step(self, *commands: Command, seconds: float = TICK) -> Fork:
        """Return the simulation after ``seconds``, in ticks of 10 ms; this one stays as it is.

        Args:
            commands: commands of `katana450.sdk.commands`, which the first tick takes.
            seconds: duration [s]; that of one tick without it.

        Raises:
            InputError: a command is invalid, or the duration is not above 0.
        """
        if not 0.0 < seconds < math.inf:
            raise InputError(f"`seconds` must be above 0, not {seconds}.")
        state, ticks = self.state, max(round(seconds / TICK), 1)
        for number in range(ticks):
            t = self.state.t + seconds * (number + 1) / ticks
            state = self.session.step(state, () if number else commands, t)
            state = Session.observe(state, state.setpoint, state.gripper_setpoint)
        return Fork(self.session, state)


class Recording:
    """A recording of an arm. Its content is read when it is used.

    Arrays have one row for each of N states, which are those that differ from the one before.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open the recording at ``path``. Raises InputError for a file that is none.

        Args:
            path: an MCAP file of katana450.
        """
        self.path = Path(path)
        with RecordingFile.open(self.path) as file:
            self.metadata: Mapping[str, str] = dict(file.metadata)
            """Program, machine and settings that made it, by name."""
            self.start, self.end = file.start, file.end
            """Times of begin and end [s], on the clock of the recording."""
            self.utc_offset = file.utc_offset
            """Seconds to add to its times for seconds since the epoch."""

    def __repr__(self) -> str:
        return f"Recording({str(self.path)!r}, {self.end - self.start:.1f} s)"

    @cached_property
    def _columns(self) -> Mapping[str, FloatArray]:
        with RecordingFile.open(self.path) as file:
            return columns(file, self.start, self.end)

    def _column(self, name: str) -> FloatArray:
        if name not in self._columns:
            raise InputError(f"{self.path} has no {name}: its robot has joints only, without tool.")
        return self._columns[name]

    @property
    def t(self) -> FloatArray:
        """Times (N,) [s], on the clock of the recording."""
        return self._column("t")

    @property
    def q(self) -> FloatArray:
        """Joints (N, n) as the driver reported them [rad, or m where they slide]."""
        return self._column("q")

    @property
    def qd(self) -> FloatArray:
        """Rates (N, n) of the setpoints [rad/s or m/s]."""
        return self._column("qd")

    @property
    def setpoint(self) -> FloatArray:
        """Setpoints (N, n) of the joints [rad or m]."""
        return self._column("setpoint")

    @property
    def gripper(self) -> FloatArray:
        """Finger joint (N,) as the driver reported it [rad or m]."""
        return self._column("gripper")

    @property
    def position(self) -> FloatArray:
        """Tool point (N, 3) in the base frame [m]. Raises InputError for a robot without a tool."""
        return self._column("position")

    @cached_property
    def orientation(self) -> FloatArray:
        """Unit quaternion (N, 4) x, y, z, w of the tool in the base frame. Raises InputError."""
        with RecordingFile.open(self.path) as file:
            return orientations(file, self.start, self.end)

    @cached_property
    def commands(self) -> tuple[RecordedCommand, ...]:
        """All commands in order, with their times and who gave them. Raises InputError."""
        with RecordingFile.open(self.path) as file:
            return tuple(
                RecordedCommand(t, command, "" if actor is None else actor.name)
                for t, (command, actor) in given_commands(file)
                if t >= self.start
            )

    @cached_property
    def events(self) -> tuple[Mapping[str, Any], ...]:
        """All events, each with its time ``t`` [s] and its ``kind``. Raises InputError."""
        with RecordingFile.open(self.path) as file:
            return tuple(content_of(message, dict) for message in file.messages(EVENTS))

    @cached_property
    def programs(self) -> tuple[RecordedProgram, ...]:
        """All runs of scripts by their begin, with the texts. Raises InputError."""
        with RecordingFile.open(self.path) as file:
            texts = {attachment.name: attachment.data for attachment in file.attachments()}
            runs = [run for run in script_runs([file]) if run.script in texts]
        for run in runs:
            if sha256(texts[run.script]) != run.sha256:
                raise InputError(f"{self.path} is damaged: {run.script} is not the text that ran.")
        return tuple(
            RecordedProgram(run.name, run.start, run.end, texts[run.script].decode("utf-8"))
            for run in runs
        )

    @cached_property
    def episodes(self) -> tuple[Episode, ...]:
        """All episodes, by number; the file of an episode has one. Raises InputError."""
        with RecordingFile.open(self.path) as file:
            return episodes_in(file)

    def verify(self, urdf: str | os.PathLike[str] | None = None) -> Verification:
        """Simulate the commands again, and return the comparison with every recorded tick.

        The result is a sentence by ``str``; its ``identical`` tells whether every bit is the same.
        That needs the same libraries, and for recordings that no server made the same processor.

        Args:
            urdf: file of the recorded robot, if it is not the Katana450 of this package.

        Raises:
            InputError: the file is damaged, or is of another robot.
        """
        return verified(self.path, None if urdf is None else Path(urdf))

    def fork(self, t: float, *, urdf: str | os.PathLike[str] | None = None) -> Fork:
        """Return a simulation that continues from a moment, to the bit as the arm did.

        Args:
            t: the moment [s] after the start of the recording.
            urdf: file of the recorded robot, if it is not the Katana450 of this package.

        Raises:
            InputError: the moment is outside the recording, is not recorded completely or cannot
                be simulated exactly; the file is damaged, or is of another robot.

        Example:
            >>> from katana450.sdk import commands
            >>> fork = katana450.open(path).fork(1.0)
            >>> other = fork.step(commands.Home(), seconds=0.5)
            >>> round(other.state.t - fork.state.t, 3)
            0.5
        """
        with RecordingFile.open(self.path) as file:
            session = session_for(file, None if urdf is None else Path(urdf)).session
            return Fork(session, simulated_state(file, session, t))

    def script(
        self,
        start: float | None = None,
        end: float | None = None,
        *,
        urdf: str | os.PathLike[str] | None = None,
    ) -> str:
        """Return the script that runs this motion again, as ``katana450 record again`` does.

        Args:
            start: start of the part [s] after that of the recording; None for that of the episode
                if the file is one, which may be trimmed, or else of the recording.
            end: its end [s]; None as for ``start``.
            urdf: file of the recorded robot, if it is not the Katana450 of this package.

        Raises:
            InputError: the part has no motion or a gap, is too long for a script, or is of another
                robot.
        """
        with RecordingFile.open(self.path) as file:
            robot = session_for(file, None if urdf is None else Path(urdf))
            return script_of_part(file, robot, start, end)


def open(path: str | os.PathLike[str]) -> Recording:
    """Return the recording at ``path``. Raises InputError if it is none.

    A recording is an MCAP file that `katana450 serve` writes, also one without an end, as after a
    crash.

    Args:
        path: the file.
    """
    return Recording(path)
