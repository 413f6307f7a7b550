"""The complete states of a recording, made by simulating its commands."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from katana450.arm.control.modes import IDLE
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
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


def recorded_states(
    file: RecordingFile, session: Session, start: float = -math.inf, end: float = math.inf
) -> Iterator[State]:
    """Yield the states from ``start`` to ``end`` [s], on the clock of the recording.

    The simulation begins at the last complete state before ``start``; the last state before
    ``start`` comes first. After a gap it continues at the next complete state. Raises InputError
    for a damaged recording, and for one of another robot.
    """
    reader = TickReader()
    for message in file.messages(PLANS, SOLIDS, end=end):
        reader.add_shared(message)
    first = file.last_before(CHECKPOINTS, start) if math.isfinite(start) else None
    begin = -math.inf if first is None else first.t
    state: State | None = None
    waiting: State | None = None
    for message in file.messages(COMMANDS, CHECKPOINTS, start=begin, end=end):
        if message.topic == CHECKPOINTS:
            if state is not None:
                continue
            state = reader.checkpoint(message)
            check_fits(session, state)
        elif state is None:
            continue
        elif isinstance(tick := reader.tick(message), TickMessage):
            state = None
            continue
        else:
            state = after(session, state, tick)
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
