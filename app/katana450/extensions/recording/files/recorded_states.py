"""The complete states of a recording, made by simulating its commands."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from katana450.arm.control.modes import IDLE
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.recording.files.checking import TickReader
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    COMMANDS,
    PLANS,
    SOLIDS,
    TickMessage,
)
from katana450.extensions.recording.replay import after, check_fits
from katana450.maths.motion.limiter import JointMotion

MOMENT = 1e-6
"""[s] Time that is less than any between two ticks."""


def simulated_states(
    file: RecordingFile,
    session: Session,
    start: float,
    end: float,
    lost: Callable[[int], None] | None = None,
) -> Iterator[State]:
    """Yield the states from the last complete state before ``start`` to ``end`` [s].

    After a gap it continues at the next complete state. Raises InputError for a damaged recording,
    and for one of another robot.

    Args:
        file: the recording.
        session: the rules of its robot.
        start: first time of interest, on the clock of the recording [s].
        end: last time [s].
        lost: called with the number of ticks that cannot be simulated. Each complete state is taken
            then, also after ticks that rules of another version refuse. None raises their errors.
    """
    reader = TickReader()
    for message in file.messages(PLANS, SOLIDS, end=end):
        reader.add_shared(message)
    first = file.last_before(CHECKPOINTS, start) if math.isfinite(start) else None
    state: State | None = None
    begun = False
    begin = -math.inf if first is None else first.t - MOMENT
    for message in file.messages(COMMANDS, CHECKPOINTS, start=begin, end=end):
        if message.topic == CHECKPOINTS:
            if state is not None and lost is None:
                continue
            state, begun = reader.checkpoint(message), True
            check_fits(session, state)
            yield state
            continue
        tick = reader.tick(message)
        if isinstance(tick, TickMessage):
            missing, state = tick.ticks, None
        elif state is None:
            missing = int(begun)
        else:
            try:
                state = after(session, state, tick)
            except InputError:
                if lost is None:
                    raise
                missing, state = 1, None
            else:
                yield state
                continue
        if lost is not None:
            lost(missing)


def recorded_states(
    file: RecordingFile, session: Session, start: float = -math.inf, end: float = math.inf
) -> Iterator[State]:
    """Yield the states from ``start`` to ``end`` [s], on the clock of the recording.

    The last state before ``start`` comes first. Raises InputError as ``simulated_states``.
    """
    waiting: State | None = None
    for state in simulated_states(file, session, start, end):
        if state.t <= start:
            waiting = state
            continue
        if waiting is not None:
            yield waiting
            waiting = None
        yield state
    if waiting is not None:
        yield waiting


def at_rest(state: State) -> State:
    """Return ``state`` with the arm at rest, in no mode and not stopped, at the time 0."""
    rest = JointMotion.rest(state.setpoint)
    return replace(
        state, t=0.0, stopped=None, paused=False, blocked=False, findings=(), mode=IDLE,
        motion=rest, goal=rest.q, q=rest.q, gripper=state.gripper_setpoint,
        gripper_goal=state.gripper_setpoint, outcomes=(), presses=(), speed=1.0,
    )  # fmt: skip
