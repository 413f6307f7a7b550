"""Sessions of published arms that are driven by their tool, without links and contacts."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np

from katana450.arm.control.arm import NO_GRIPPER, ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from tests.ticks import ticked


@cache
def session_of(chain: Chain) -> Session:
    """Return the session of an arm that starts in its ready posture."""
    arm = ArmModel(chain, {"tcp": chain.M}, "tcp", NO_GRIPPER, to_tool=DrivenTool)
    return Session(arm, arm.kinematics.ready((), np.eye(4)))


def begun(session: Session) -> State:
    """Return the arm at rest in its ready posture."""
    return session.begin(session.ready, 0.0, 0.0)


def run(
    session: Session, state: State, commands: Iterable[cmd.Command] = (), ticks: int = 1
) -> State:
    """Return ``state`` after some ticks; the commands come with the first."""
    return ticked(session, state, *commands, ticks=ticks)


def settled(session: Session, state: State, commands: Iterable[cmd.Command] = ()) -> State:
    """Return ``state`` after the end of its motion."""
    state = run(session, state, commands)
    for _ in range(3000):
        if not state.moving and state.since is None:
            return state
        state = run(session, state)
    raise AssertionError("The arm does not come to rest.")


def pose(session: Session, state: State) -> FloatArray:
    """Return the pose (4, 4) of the tool."""
    return forward(session.require_arm().chain_to(state.tool), state.q)


def ready(chain: Chain) -> tuple[Session, State, FloatArray]:
    """Return a session of an arm, its state at rest, and the pose (4, 4) of its tool there."""
    session = session_of(chain)
    state = begun(session)
    return session, state, pose(session, state)
