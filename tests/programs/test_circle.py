"""Test of the paper's first experiment, run to its end on an arm without gripper."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.maths.kinematics.forward import forward
from tests.programs.conftest import Stage


@pytest.mark.parametrize(("tool", "name"), [("flange", "circle"), ("tcp", "circle_with_gripper")])
def test_the_circle_keeps_every_limit_at_every_tick(
    arm: MountedArm, stage: Stage, tool: str, name: str
) -> None:
    staged = Stage(arm, bare=True) if tool == "flange" else stage
    script = parse(script_text(library_file(name)))
    run, states = staged.play(compiled(script, staged.plan_context, staged.begin()), staged.begin())
    assert (run.phase, run.why) == (Phase.DONE, "")
    assert staged.loads(states).max() <= 1.0 + 1e-6
    chain = staged.plan_context.arm.chain_to(tool)
    on = [s.q for s in states if s.following is not None and s.following.plan.length > 0.6]
    points = np.array([forward(chain, q)[:3, 3] for q in on])
    assert len(points) > 100
    away = np.hypot(points[:, 1], points[:, 2] + 0.11)
    assert np.abs(away - 0.1).max() < 1e-12
    assert np.abs(points[:, 0] - 0.15).max() < 1e-12
