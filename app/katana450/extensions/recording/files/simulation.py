"""Simulation of recorded commands: compared with the recording, or for complete states.

A verification rounds as the process that recorded: in a process of its own if this one does not.
"""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.runtime.tick import Submission
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.atomic import bytes_of
from katana450.errors import InputError
from katana450.extensions.recording.codec import Codec, SharedText
from katana450.extensions.recording.files.header import PORTABLE, ROUNDING
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.forms import FormError, json_form
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    COMMANDS,
    PLANS,
    SHARED_TOPICS,
    SOLIDS,
    STATE,
    CheckpointMessage,
    SharedMessage,
    StateRow,
    TickMessage,
)
from katana450.extensions.recording.ticks import (
    Difference,
    Digester,
    TickInput,
    Verification,
    after,
    check_fits,
    tick_input,
)
from katana450.maths.geometry.arrays import FloatArray
from katana450.portable_rounding import ROUNDS_PORTABLY, can_round_portably, portable_rounding
from katana450.resources import URDF_PATH
from katana450.settings import Settings

T = TypeVar("T")

KINDS = {topic: kind for kind, topic in SHARED_TOPICS.items()}


class TickReader:
    """Reads the messages from which a session is simulated. For one file, in its order."""

    def __init__(self) -> None:
        self._codec = Codec()

    def add_shared(self, message: Message) -> None:
        """Remember the plan or solid in ``message``. Raises InputError."""
        with _placed(message):
            entry: SharedMessage = json_form(message.data, SharedMessage)
            self._codec.shared.add(SharedText(KINDS[message.topic], entry.key, bytes(entry.value)))

    def tick(self, message: Message) -> TickInput | TickMessage:
        """Return the tick in ``message``, or the note that it is missing. Raises InputError."""
        with _placed(message):
            tick: TickMessage = json_form(message.data, TickMessage)
            return tick if tick.missing is not None else tick_input(self._codec, tick)

    def field(self, message: Message, name: str, default: Any) -> Any:
        """Return the field ``name`` of the state in ``message``. Raises InputError."""
        with _placed(message):
            form = json_form(message.data, CheckpointMessage).state
            if not isinstance(form, dict):
                raise FormError("it is not a state")
            return self._codec.field(State, name, form[name]) if name in form else default

    def checkpoint(self, message: Message) -> State:
        """Return the state in ``message``. Raises InputError."""
        with _placed(message):
            checkpoint: CheckpointMessage = json_form(message.data, CheckpointMessage)
            state: State = self._codec.decoded(State, checkpoint.state)
            return state


def given_commands(
    file: RecordingFile, end: float = math.inf
) -> Iterator[tuple[float, Submission]]:
    """Yield the commands up to ``end`` [s] with the times at which the arm took them.

    Raises InputError.
    """
    reader = TickReader()
    for message in file.messages(PLANS, SOLIDS, COMMANDS, end=end):
        if message.topic != COMMANDS:
            reader.add_shared(message)
        elif not isinstance(tick := reader.tick(message), TickMessage):
            for submission in tick.submissions:
                yield tick.t, submission


def content_of(message: Message, kind: type[T]) -> T:
    """Return the content of ``message``, which is of ``kind``. Raises InputError."""
    with _placed(message):
        content: T = json_form(message.data, kind)
        return content


@contextmanager
def _placed(message: Message) -> Iterator[None]:
    """Report a fault of ``message`` with its topic and time."""
    try:
        yield
    except (FormError, msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        place = f"the message of {message.topic} at t = {message.t:.3f} s"
        raise InputError(f"The recording is damaged in {place}: {error}.") from error


def verify_recording(
    file: RecordingFile, session: Session, progress: Callable[[float], None] | None = None
) -> Verification:
    """Return the comparison of ``file`` with its simulation by ``session``.

    ``progress`` is called with the time [s] of each simulated tick. Raises InputError for a damaged
    recording, and for one of another robot.
    """
    reader, digester = TickReader(), Digester()
    state: State | None = None
    setpoint = np.empty(0)
    ticks = unknown = 0
    differences: list[Difference] = []
    for messages in _by_tick(file, reader):
        commands, row, checkpoint = map(messages.get, (COMMANDS, STATE, CHECKPOINTS))
        if row is not None:
            setpoint = np.array(content_of(row, StateRow).setpoint)
        tick = None if commands is None else reader.tick(commands)
        if isinstance(tick, TickMessage):
            unknown, state = unknown + tick.ticks, None
        elif tick is not None and state is not None:
            state = after(session, state, tick)
            ticks += 1
            if digester.digest(state) != tick.digest:
                differences.append(Difference(tick.t, _apart(state.setpoint, setpoint)))
            if progress is not None:
                progress(tick.t)
        elif tick is not None and checkpoint is None:
            unknown += 1
        if state is None and checkpoint is not None:
            # The tick that ended in this state need not be simulated.
            state = reader.checkpoint(checkpoint)
            check_fits(session, state)
    first = differences[0] if differences else None
    largest = max(differences, key=lambda difference: difference.size, default=None)
    return Verification(ticks, len(differences), first, largest, unknown)


def _by_tick(file: RecordingFile, reader: TickReader) -> Iterator[dict[str, Message]]:
    """Yield the last message of each topic about a tick, from its commands on.

    ``reader`` takes the values that they share. A part may begin with the state after a tick.
    """
    messages: dict[str, Message] = {}
    for message in file.messages(PLANS, SOLIDS, COMMANDS, CHECKPOINTS, STATE):
        if message.topic in KINDS:
            reader.add_shared(message)
            continue
        if message.topic == COMMANDS and messages:
            yield messages
            messages = {}
        messages[message.topic] = message
    if messages:
        yield messages


def _apart(simulated: FloatArray, recorded: FloatArray) -> float:
    """Return the largest difference of two setpoints (n,) [rad or m]; 0 of another robot."""
    if simulated.shape != recorded.shape:
        return 0.0
    return float(np.abs(simulated - recorded).max(initial=0.0))


def gaps_in(file: RecordingFile, start: float, end: float) -> Iterator[tuple[float, TickMessage]]:
    """Yield the gaps from ``start`` to ``end`` [s], each with its time [s].

    Raises InputError for a damaged recording.
    """
    for message in file.messages(COMMANDS, start=start, end=end):
        if b'"missing"' not in message.data:
            continue
        gap = content_of(message, TickMessage)
        if gap.missing is not None:
            yield message.t, gap


def check_whole(file: RecordingFile, first: float, last: float) -> None:
    """Raise InputError with the time of the first gap from ``first`` to ``last`` [s]."""
    first_gap = next(gaps_in(file, first, last), None)
    if first_gap is not None:
        t, gap = first_gap
        raise InputError(
            f"{file.path} has a gap at {t - file.start:.2f} s: {gap.ticks} ticks are missing "
            f"({gap.missing}). Leave the file out, or choose a part before or after it by --from "
            "and --to."
        )


def session_for(file: RecordingFile, urdf: Path | None = None) -> DescribedRobot:
    """Return the robot of ``file`` with a new session like the recorded one.

    ``urdf``: its file, if it is not the robot of this program. Raises InputError if it is another
    robot, and RobotDescriptionError if its files cannot be read.
    """
    recorded = file.metadata.get("urdf_sha256")
    path = URDF_PATH if urdf is None else urdf
    if hashlib.sha256(bytes_of(path)).hexdigest() != recorded:
        raise InputError(
            f"{file.path} is a recording of {file.metadata.get('urdf', 'another robot')!r}, not of "
            f"{path}. Name the same URDF, with its meshes beside it, by --urdf."
        )
    used = file.settings
    try:
        settings = Settings(ready=used.ready, bare=used.bare)
    except (ValueError, TypeError) as error:
        raise InputError(f"{file.path} does not state the settings of its session.") from error
    return find_robot(settings, path, used.tool)


def verified(
    path: Path, urdf: Path | None = None, progress: Callable[[float, float], None] | None = None
) -> Verification:
    """Return the comparison of the recording at ``path`` with its simulation.

    The simulation runs in a process of its own if this one rounds otherwise than the server did,
    and this processor has the rounding of the server.

    Args:
        path: file of the recording.
        urdf: file of its robot, if it is not the one of this program.
        progress: called with the simulated time and the whole time [s]; a separate process shows
            its progress itself, on standard error.

    Raises:
        InputError: the file is damaged, or is of another robot.
        RobotDescriptionError: the files of the robot cannot be read.
    """
    with RecordingFile.open(path) as file:
        if simulates_apart(file):
            return _verified_apart(path, urdf, shows=progress is not None)
        start, length = file.start, file.end - file.start
        inner = None if progress is None else lambda t: progress(t - start, length)
        return verify_recording(file, session_for(file, urdf).session, inner)


def simulates_apart(file: RecordingFile) -> bool:
    """Return whether ``file`` is simulated in a process that rounds otherwise than this one."""
    portable = file.metadata.get(ROUNDING) == PORTABLE
    return portable and can_round_portably() and not ROUNDS_PORTABLY


def _verified_apart(path: Path, urdf: Path | None, *, shows: bool) -> Verification:
    # -P: Python does not search the current folder, which may contain an `app.py`.
    command = [sys.executable, "-P", "-m", "katana450", "record", "verify", str(path), "--json"]
    if urdf is not None:
        command += ["--urdf", str(urdf)]
    done = subprocess.run(
        command,
        env=portable_rounding(os.environ),
        stdout=subprocess.PIPE,
        stderr=None if shows else subprocess.PIPE,
        check=False,
    )
    try:
        answer = msgspec.json.decode(done.stdout)
        if "error" in answer:
            raise InputError(answer["error"])
        return msgspec.convert(answer, Verification)
    except msgspec.MsgspecError as error:
        text = (done.stderr or b"").decode(errors="replace").strip()
        raise InputError(
            f"The process that simulates {path} ended with status {done.returncode}. {text}"
        ) from error


MOMENT = 1e-6
"""[s] Time that is less than any between two ticks."""


def recorded_input(
    file: RecordingFile, start: float, end: float
) -> Iterator[State | TickInput | TickMessage]:
    """Yield the complete states, the ticks, and the notes that ticks are missing, in their order.

    They begin with the last complete state before ``start`` and end at ``end`` [s]. Raises
    InputError for a damaged recording.
    """
    reader = TickReader()
    for message in file.messages(PLANS, SOLIDS, end=end):
        reader.add_shared(message)
    first = file.last_before(CHECKPOINTS, start) if math.isfinite(start) else None
    begin = -math.inf if first is None else first.t - MOMENT
    for message in file.messages(COMMANDS, CHECKPOINTS, start=begin, end=end):
        is_complete = message.topic == CHECKPOINTS
        yield reader.checkpoint(message) if is_complete else reader.tick(message)


def check_inside(file: RecordingFile, t: float) -> None:
    """Raise InputError if ``file`` does not have the moment ``t`` [s] after its start."""
    length = file.end - file.start
    if not 0.0 <= t <= length:
        raise InputError(f"{file.path} is {length:.2f} s long, so it has no moment {t:g} s.")


def simulated_state(file: RecordingFile, session: Session, t: float) -> State:
    """Return the state of ``file`` at ``t`` [s] after its start. Raises as ``state_after``.

    Where this process rounds otherwise than the server did, setpoints may differ by SAME.
    """
    check_inside(file, t)
    t, exact = file.start + t, not simulates_apart(file)
    state = state_after(session, list(recorded_input(file, t, t)), exact=exact)
    row = file.last_before(STATE, t)
    recorded = state.setpoint if row is None else np.array(content_of(row, StateRow).setpoint)
    if _apart(state.setpoint, recorded) > SAME:
        raise InputError(INEXACT)
    return state


SAME = 1e-6
"""[rad or m] Difference of a setpoint that the rounding of some simulated seconds can make."""

INEXACT = (
    "This moment cannot be simulated exactly: it was recorded by another version, or on a "
    "processor that rounds otherwise. Choose the start of the recording."
)


def state_after(
    session: Session, tick_inputs: Sequence[State | TickInput | TickMessage], *, exact: bool = True
) -> State:
    """Return the state after the last tick of ``tick_inputs``, as in ``recorded_input``.

    Raises InputError if it is not known, or is not the recorded one to the bit, unless that need
    not be ``exact``.
    """
    state = next(iter(deque(simulated_states(session, tick_inputs), 1)), None)
    if state is None:
        raise InputError("This moment is not recorded completely. Choose a later one.")
    last = tick_inputs[-1]
    if exact and isinstance(last, TickInput) and Digester().digest(state) != last.digest:
        raise InputError(INEXACT)
    return state


def simulated_states(
    session: Session,
    tick_inputs: Iterable[State | TickInput | TickMessage],
    lost: Callable[[int], None] | None = None,
) -> Iterator[State | None]:
    """Yield the state after each of ``tick_inputs``, as in ``recorded_input``; None if unknown.

    After a gap it is known again at the next complete state. Raises InputError for a damaged
    recording, and for one of another robot.

    Args:
        session: the rules of the robot.
        tick_inputs: the complete states and ticks.
        lost: called with the number of ticks that cannot be simulated, also of those that rules of
            another version refuse. None raises their errors.
    """
    state: State | None = None
    started = False
    for tick in tick_inputs:
        missing = 0
        if isinstance(tick, State):
            check_fits(session, tick)
            state, started = tick, True
        elif isinstance(tick, TickMessage):
            missing, state = tick.ticks, None
        elif state is None:
            missing = int(started)
        else:
            try:
                state = after(session, state, tick)
            except InputError:
                if lost is None:
                    raise
                missing, state = 1, None
        if missing and lost is not None:
            lost(missing)
        yield state
