"""Test named poses as points, and corners and waits of size 0."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.tool import ToolTarget
from tests.programs.conftest import Stage

HEAD = """\
tool: tcp
frame: base
poses:
  corner: {x: 320, y: -40, z: 150, pitch: 50, roll: 0}
  above: {x: 320, y: -40, z: 200, pitch: 60}
  folded: {joints: [0, -68, 85, 8, 0]}
steps:
  - move: corner
"""


def planned(stage: Stage, steps: str) -> Program:
    return stage.planned(HEAD + steps)


def end(stage: Stage, program: Program) -> ToolTarget:
    """Return the tool pose at the end of ``program``, in {S}."""
    plans = [task.action.plan for task in program.tasks if isinstance(task.action, FollowPlan)]
    return ToolTarget.at(stage.plan_context.arm.chain_to("tcp"), plans[-1].end)


def in_base(stage: Stage, p: FloatArray) -> FloatArray:
    """Return the point ``p`` (3,) [m] of {S} in the base frame [mm]."""
    T = stage.plan_context.T_base_shoulder
    return np.asarray(1e3 * (T[:3, :3] @ p + T[:3, 3]))


def test_line_goes_to_a_named_pose_with_its_pitch(stage: Stage) -> None:
    target = end(stage, planned(stage, "  - line: {to: above}\n"))
    assert in_base(stage, target.position) == pytest.approx([320, -40, 200], abs=1e-6)
    assert np.degrees(target.pitch) == pytest.approx(60.0)
    assert np.degrees(target.roll) == pytest.approx(0.0, abs=1e-9)
    target = end(stage, planned(stage, "  - line: {to: above, pitch: 45}\n"))
    assert np.degrees(target.pitch) == pytest.approx(45.0)


def test_named_pose_is_the_centre_of_an_arc(stage: Stage) -> None:
    target = end(stage, planned(stage, "  - arc: {centre: above, axis: y, angle: 20}\n"))
    a = np.radians(20.0)
    wanted = [320 - 50 * np.sin(a), -40, 200 - 50 * np.cos(a)]
    assert in_base(stage, target.position) == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize(
    "step", ["line: {to: folded}", "arc: {centre: folded, axis: y, angle: 20}"]
)
def test_pose_by_joints_is_no_point(step: str) -> None:
    with pytest.raises(ScriptError, match=r"it is no point\. Use it in `move`") as refused:
        parse(f"{HEAD}  - {step}\n")
    assert refused.value.problems[0].line == 9


@pytest.mark.parametrize("step", ["lines", "via"])
def test_blend_of_0_rests_in_each_corner(stage: Stage, step: str) -> None:
    program = planned(
        stage,
        f"  - {step}:\n      through: [{{x: 320, y: 0, z: 150}}, {{x: 350, y: 0, z: 150}}]\n"
        "      blend: 0\n",
    )
    _, states = stage.play(program, stage.begin())
    assert stage.rests(states)[1:] == [
        pytest.approx(np.array([320, -40, 150]), abs=1e-6),
        pytest.approx(np.array([320, 0, 150]), abs=1e-6),
    ]
    assert in_base(stage, end(stage, program).position) == pytest.approx([350, 0, 150], abs=1e-6)


def test_blend_too_small_to_drive_is_refused() -> None:
    with pytest.raises(ScriptError, match=r"0\.001 is too small to drive"):
        parse(f"{HEAD}  - lines: {{through: [above, corner], blend: 0.001}}\n")


def test_wait_of_0_does_nothing(stage: Stage) -> None:
    assert len(planned(stage, "  - wait: 0\n").tasks) == len(planned(stage, "").tasks)


@pytest.mark.parametrize(
    ("step", "why"),
    [
        ("line: {by: {y: 20}, yaw: 10}", "yaw of a five-axis arm follows"),
        ("move: {x: 320, y: 0, z: 150, yaw: 10}", "yaw of a five-axis arm follows"),
        ("move: {x: 320, y: 0, z: 150, branch: front-up-noflip}", "no branch 'front-up-noflip'"),
        ("circle: {centre: corner, normal: x, radius: 10, yaw: 5}", "yaw of a five-axis arm"),
    ],
)
def test_what_only_other_arms_have_is_refused(stage: Stage, step: str, why: str) -> None:
    with pytest.raises(ScriptError, match=why):
        planned(stage, f"  - {step}\n")
