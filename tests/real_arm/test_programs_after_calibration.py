"""Programs begin in the posture after a calibration, in which the arm reaches over its shoulder."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.extensions.programs.circle import CircleDemo
from katana450.extensions.programs.clocked_run import plan_script, run_by_clock
from katana450.extensions.programs.pour import PourDemo
from katana450.extensions.programs.runner import Phase
from katana450.extensions.programs.script import parse
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.posture import joints_at
from katana450.resources import URDF_PATH


@pytest.mark.parametrize(
    "text",
    [
        CircleDemo().text,
        pytest.param(CircleDemo(tool="tcp").text, marks=pytest.mark.long),
        pytest.param(PourDemo().text, marks=pytest.mark.long),
    ],
    ids=["circle", "circle with gripper", "pour"],
)
def test_program_begins_in_the_posture_after_a_calibration(text: str) -> None:
    q, gripper = joints_at(EmulatedArm(calibrated=True).counts)

    def calibrated(session: Session) -> State:
        return session.begin(q, session.require_arm().gripper.clamp(gripper), 0.0)

    plan = plan_script(parse(text), URDF_PATH, begin=calibrated)
    arm = plan.session.require_arm()
    assert arm.kinematics.branch_of(q) != arm.kinematics.branch_of(plan.session.ready)
    simulation = run_by_clock(plan)
    assert simulation.run.phase is Phase.DONE
    states = simulation.states
    np.testing.assert_allclose(states[0].q, q)
    np.testing.assert_allclose(states[-1].q, plan.session.ready, atol=1e-9)
