"""Fixtures: the arm with scene objects, and its session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.assembly.robot_session import describe_robot
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.view.conftest import server

__all__ = ["server"]

TICK, PREVIEW_TICK = 0.01, 0.02
"""[s] Periods of the control loop, and of the simulation of a preview."""


def pour_text(**spots: tuple[float, float] | None) -> str:
    """Return the demo of pouring with cup and basin at other ``spots`` on the table [mm]."""
    puts = "".join(
        f"  - put: {{object: {name}, x: {spot[0]:g}, y: {spot[1]:g}}}\n"
        for name, spot in spots.items()
        if spot is not None
    )
    return script_text(library_file("pour")).replace("steps:\n", f"steps:\n{puts}")


class Stage:
    """A session on a simulated clock that runs programs."""

    def __init__(self, arm: MountedArm, *, bare: bool = False) -> None:
        """Build the session. ``bare``: without the gripper."""
        self.session = describe_robot(replace(Settings(), bare=bare), URDF_PATH, None).session
        self.plan_context = PlanContext(self.session, arm.T_base_shoulder)

    def begin(self) -> State:
        return self.session.begin(self.session.ready, 0.0, 0.0)

    def planned(self, text: str, state: State | None = None, **options: Any) -> Program:
        """Return the program of a script that begins in ``state``, or ready with the scene."""
        state = self.begin() if state is None else state
        return compiled(parse(text), self.plan_context, state, **options)

    def tick(
        self, program: Program, run: Run, state: State, period: float = TICK
    ) -> tuple[Run, State]:
        run, commands = runner.step(program, run, state, state.t)
        state = self.session.step(state, commands, state.t + period)
        return run, self.session.observe(state, state.setpoint, state.gripper_setpoint)

    def loads(self, states: Sequence[State]) -> FloatArray:
        """Return the maximum speed, acceleration and jerk of all joints (3,), relative to limits.

        They are differences of the setpoints, so means of the derivatives.
        """
        limits = self.plan_context.arm.limits
        q = np.array([state.setpoint for state in states])
        bounds, period = (limits.speed, limits.acceleration, limits.jerk), states[1].t - states[0].t
        ratios = [
            (np.abs(np.diff(q, order, axis=0)) / period**order / most).max()
            for order, most in enumerate(bounds, start=1)
        ]
        return np.array(ratios)

    def play(
        self, program: Program, state: State, most: int = 5000, period: float = TICK
    ) -> tuple[Run, list[State]]:
        """Run ``program`` to its end; return the run and all states."""
        run, states = Run(state.t, number=program.first), [state]
        while run.phase is Phase.RUNNING and len(states) < most:
            run, state = self.tick(program, run, state, period)
            states.append(state)
        return run, states

    def point(self, state: State) -> FloatArray:
        """Return the tool point ``tcp`` in the base frame [mm]."""
        context = self.plan_context
        T = context.T_base_shoulder @ forward(context.arm.chain_to("tcp"), state.q)
        return np.asarray(1e3 * T[:3, 3])

    def rests(self, states: Sequence[State]) -> list[FloatArray]:
        """Return the tool points [mm] in the base frame from which the arm begins to move."""
        pairs = pairwise(states)
        return [self.point(a) for a, b in pairs if a.motion.at_rest and not b.motion.at_rest]


@pytest.fixture(scope="session")
def stage(arm: MountedArm) -> Stage:
    return Stage(arm)


@pytest.fixture
def home(stage: Stage) -> np.ndarray:
    return np.array(stage.session.ready)
