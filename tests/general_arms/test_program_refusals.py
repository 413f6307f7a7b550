"""Refusals of scripts of other arms: beyond the reach, at singularities and limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.planning.curves import line_between
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.runner import Phase, Run, step
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.path import joint_derivatives
from tests.general_arms.driven import pose, session_of
from tests.general_arms.programs import (
    REST,
    angles_of,
    begin_plan,
    every,
    length,
    plans,
    point,
    program,
)
from tests.general_arms.published_arms import KR_6, OPENMANIPULATOR_X, PANDA, PUMA_560, UR5E
from tests.ticks import TICK


@every({"UR5e": UR5E, "OpenMANIPULATOR-X": OPENMANIPULATOR_X}, {"KR 6": KR_6, "Panda": PANDA})
def test_line_beyond_the_reach_is_refused_with_the_place(chain: Chain) -> None:
    with pytest.raises(ScriptError) as refused:
        program(chain, "line: {by: {x: 1900}}")
    text = str(refused.value)
    assert "% along it, at (" in text
    assert "mm in the base frame" in text
    # Seven axes that keep their arm angle come to a singularity first.
    cause = "comes to a singularity" if chain is PANDA else "leaves the reach of the arm"
    assert f"The path {cause}" in text


WRIST = {
    # Postures with the wrist on one side of its singularity.
    "UR5e": (UR5E, (0.3, -1.2, 1.4, -1.0, 0.25, 0.2)),
    "KR 6": (KR_6, (0.2, -1.0, 1.2, 0.0, 0.25, 0.1)),
    "Puma 560": (PUMA_560, (0.2, -0.6, 0.9, 0.0, 0.25, 0.1)),
}


def run_from(chain: Chain, q: FloatArray, text: str) -> tuple[Program, State, PlanContext]:
    """Return the program of one step from the joint angles `q`, and where it begins."""
    session = session_of(chain)
    state, context = session.begin(q, 0.0, 0.0), PlanContext(session, np.eye(4))
    return compiled(parse(f"frame: base\nsteps:\n  - {text}\n"), context, state), state, context


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", WRIST)
def test_line_through_a_singularity_is_refused_with_its_axes(name: str) -> None:
    chain, angles = WRIST[name]
    q, other = np.array(angles), np.array(angles)
    other[4] = -q[4]
    end = forward_batch(chain, other[None])[0]
    to = f"{point(1e3 * end[:3, 3])[:-1]}, {angles_of(end[:3, :3])}}}"
    with pytest.raises(ScriptError) as refused:
        run_from(chain, q, f"line: {{to: {point(1e3 * end[:3, 3])}, {angles_of(end[:3, :3])}}}")
    text = str(refused.value)
    assert "comes to a singularity" in text
    assert "% along it, at (" in text
    assert "axes 4 and 6" in text
    # What the message proposes: `move` leads there.
    assert "`move`" in text
    compiled_program, _, _ = run_from(chain, q, f"move: {to}")
    reached = forward_batch(chain, plans(compiled_program)[-1].end[None])[0]
    np.testing.assert_allclose(reached, end, atol=1e-8)


def test_line_beside_a_singularity_turns_the_wrist_within_its_limits() -> None:
    # The wrist passes 4 degrees beside its singularity, where axes 4 and 6 turn by 140 degrees.
    chain, q = KR_6, np.array((0.2, -1.0, 1.2, 0.3, 0.25, 0.1))
    other = q + np.array((0.0, 0.0, 0.0, 2.5, 0.0, -2.5))
    end = forward_batch(chain, other[None])[0]
    text = f"line: {{to: {point(1e3 * end[:3, 3])}, {angles_of(end[:3, :3])}}}"
    compiled_program, state, _ = run_from(chain, q, text)
    path = plans(compiled_program)[0].segments[0].path
    assert abs(path.end[3] - path.start[3]) > 2.4
    session = session_of(chain)
    run, setpoints = Run(0.0), [state.setpoint]
    while run.phase is Phase.RUNNING and len(setpoints) < 4000:
        run, commands = step(compiled_program, run, state, state.t)
        state = session.step(state, commands, state.t + TICK)
        state = session.observe(state, state.setpoint, 0.0)
        setpoints.append(state.setpoint)
    limits = session.require_arm().limits
    for order, most in enumerate((limits.speed, limits.acceleration, limits.jerk), start=1):
        load = (np.abs(np.diff(setpoints, order, axis=0)) / TICK**order / most).max()
        assert load <= 1.0 + 1e-6
    np.testing.assert_allclose(state.setpoint, other, atol=1e-6)


@every({"UR5e": UR5E}, {"Panda": PANDA, "OpenMANIPULATOR-X": OPENMANIPULATOR_X, **REST})
def test_no_path_changes_its_branch(chain: Chain) -> None:
    plan_state, rng, paths = begin_plan(chain), np.random.default_rng(4), 0
    kinematics = plan_state.plan_context.arm.kinematics
    for _ in range(12):
        start = plan_state.target
        end = start.moved(start.position + rng.normal(size=3) * 2.5e-3 * length(chain))
        if chain.n >= 6:
            end = replace(end, rotation=so3.exp(0.6 * rng.normal(size=3)) @ start.R)
        curve = line_between(plan_state.target, end)
        try:
            path = plan_state.planning.path(plan_state.q, curve, kinematics.branch_of(plan_state.q))
        except InputError:
            continue
        paths += 1
        for q in joint_derivatives(path, np.linspace(0.0, 1.0, 40))[0]:
            assert kinematics.branch_of(q) == kinematics.branch_of(path.start)
            assert chain.within_limits(q)
    assert paths > 0


@pytest.mark.parametrize(
    ("chain", "step", "message"),
    [
        (UR5E, "line: {by: {z: 3}, roll: 5, branch: left}", "has no 'branch'"),
        (UR5E, "move: {x: 500, y: 0, z: 400, branch: front-up}", "no branch 'front-up'"),
        (UR5E, "move: {x: 1900, y: 0, z: 400}", "out of reach"),
        (OPENMANIPULATOR_X, "move: {x: 0.2, y: 0.1, z: 1}", "a length in metres has its unit"),
        (UR5E, "joints: [0, 0, 0, 0, 0]", "has 6 joints, but the command has 5"),
        (UR5E, "nudge: {axis: 7, by: 5}", "6"),
        (UR5E, "circle: {centre: [400, 0, 400], normal: x, radius: 50, pitch: roomiest}", "five"),
        (UR5E, "line: {by: {x: 0}}", "moves nothing"),
        (OPENMANIPULATOR_X, "line: {yaw: 10}", "yaw of a tool with 4 axes follows"),
        (OPENMANIPULATOR_X, "line: {by: {z: 5}, roll: 45}", "turn it in one plane"),
    ],
)
def test_what_is_not_possible_is_refused_with_the_reason(
    chain: Chain, step: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        program(chain, step)


def test_limit_of_a_joint_on_a_line_is_named() -> None:
    session = session_of(KR_6)
    q = np.array((0.2, -1.0, 1.2, 0.3, 0.9, 6.0))
    context = PlanContext(session, np.eye(4))
    state = session.begin(q, 0.0, 0.0)
    # The last axis turns about itself beyond its limit.
    T = pose(session, state)
    roll, pitch, yaw = np.degrees(so3.to_rpy(T[:3, :3] @ so3.rotation_z(0.5))).tolist()
    text = f"frame: base\nsteps:\n  - line: {{roll: {roll}, pitch: {pitch}, yaw: {yaw}}}\n"
    with pytest.raises(ScriptError, match=r"axis 6, joint 6, over its limit of 350.0 deg \d+.* %"):
        compiled(parse(text), context, state)
