"""The arm with what stands around it, and its session."""

from __future__ import annotations

import numpy as np
import pytest

from app.cli.assembly import described
from app.control.state import State
from app.programs import runner
from app.programs.bench import Rig
from app.programs.program import Program
from app.programs.runner import Phase, Run
from app.robot.model import RobotModel
from app.settings import Settings
from robot_description import URDF_PATH

TICK = 0.01


class Stage:
    """A session on a clock of its own, and programs run on it."""

    def __init__(self, model: RobotModel) -> None:
        self.session = described(Settings(), URDF_PATH, None).session
        self.rig = Rig(self.session, model.T_base_shoulder)

    def begin(self) -> State:
        return self.session.begin(self.session.ready, 0.0, 0.0)

    def tick(self, program: Program, run: Run, state: State) -> tuple[Run, State]:
        run, commands = runner.step(program, run, state)
        state = self.session.step(state, commands, state.t + TICK)
        return run, self.session.observe(state, state.setpoint, state.gripper_setpoint)

    def play(self, program: Program, state: State, most: int = 5000) -> tuple[Run, list[State]]:
        """To its end, and every state on the way."""
        run, states = Run(state.t), [state]
        while run.phase is Phase.RUNNING and len(states) < most:
            run, state = self.tick(program, run, state)
            states.append(state)
        return run, states


@pytest.fixture(scope="session")
def stage(model: RobotModel) -> Stage:
    return Stage(model)


@pytest.fixture
def home(stage: Stage) -> np.ndarray:
    return np.array(stage.session.ready)
