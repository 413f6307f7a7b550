"""Programs for arms outside the five-axis family: planned and played, and their targets as text."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from katana450.arm.control.state.state import State
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.building.plan_state import PlanContext, PlanState
from katana450.extensions.programs.planning.curve_path import PosePath
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.runner import Phase, Run, step
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.plan import Plan
from tests.general_arms.driven import begun, session_of
from tests.general_arms.published_arms import (
    IIWA_7,
    KR_6,
    OPENMANIPULATOR_X,
    PANDA,
    PINCHERX_100,
    PUMA_560,
    SKEWED_6,
    SKEWED_7,
    UR5E,
)
from tests.ticks import TICK

SOME = {"UR5e": UR5E, "KR 6": KR_6, "Panda": PANDA, "OpenMANIPULATOR-X": OPENMANIPULATOR_X}
REST = {
    "Puma 560": PUMA_560,
    "iiwa": IIWA_7,
    "PincherX-100": PINCHERX_100,
    "skewed 6": SKEWED_6,
    "skewed 7": SKEWED_7,
}
NANOMETRE = 1e-9


def every(arms: Mapping[str, Chain], others: Mapping[str, Chain]) -> pytest.MarkDecorator:
    """Parametrise by arms; ``others`` are tested with the long tests."""
    cases = [pytest.param(chain, id=name) for name, chain in arms.items()]
    cases += [pytest.param(c, id=name, marks=pytest.mark.long) for name, c in others.items()]
    return pytest.mark.parametrize("chain", cases)


def begin_plan(chain: Chain) -> PlanState:
    session = session_of(chain)
    return PlanState(PlanContext(session, np.eye(4)), begun(session))


def program(chain: Chain, *steps: str) -> Program:
    """Return the steps as a program from the ready posture."""
    plan_state = begin_plan(chain)
    text = "frame: base\nsteps:\n" + "".join(f"  - {line}\n" for line in steps)
    return compiled(parse(text), plan_state.plan_context, plan_state.state)


def plans(program: Program) -> list[Plan]:
    return [task.action.plan for task in program.tasks if isinstance(task.action, FollowPlan)]


def played(chain: Chain, program: Program) -> list[State]:
    """Return the states of a run to its end."""
    session = session_of(chain)
    state, run = begun(session), Run(0.0)
    states = [state]
    while run.phase is Phase.RUNNING and len(states) < 4000:
        run, commands = step(program, run, state, state.t)
        state = session.step(state, commands, state.t + TICK)
        state = session.observe(state, state.setpoint, 0.0)
        states.append(state)
    assert (run.phase, run.why) == (Phase.DONE, "")
    return states


def on_paths(states: list[State]) -> list[tuple[PosePath, float, FloatArray]]:
    """Return path, place and joints of each tick on a path of the tool."""
    places = []
    for state in states:
        following = state.following
        if following is not None and isinstance(following.segment.path, PosePath):
            sigma = following.segment.scaling.pace(following.local).sigma
            places.append((following.segment.path, sigma, state.setpoint))
    return places


def middle(chain: Chain) -> FloatArray:
    """Return the tool point (3,) [mm] of the ready posture."""
    plan_state = begin_plan(chain)
    return 1e3 * plan_state.target.position


def length(chain: Chain) -> float:
    """Return a length [mm] that the arm can move its tool in every direction."""
    return 25.0 if chain.n == 4 else 80.0


def angles_of(R: FloatArray) -> str:
    roll, pitch, yaw = np.degrees(so3.to_rpy(R)).tolist()
    return f"roll: {roll!r}, pitch: {pitch!r}, yaw: {yaw!r}"


def point(p: FloatArray) -> str:
    return "{{x: {:.6f}, y: {:.6f}, z: {:.6f}}}".format(*p)
