"""Arms outside the five-axis family are driven by their tool."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.tool_targets import with_branch
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.state import Reason, Status, Verdict
from katana450.errors import InputError
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, joint_frames
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.velocity import JogFrame, singular_values
from tests.general_arms.driven import begun, pose, ready, run, session_of, settled
from tests.general_arms.published_arms import (
    FOUR,
    OPENMANIPULATOR_X,
    PANDA,
    SEVEN,
    SIX,
    SKEWED,
    UR5E,
)
from tests.geometry.strategies import exp
from tests.ticks import TICK

ARMS = {**FOUR, **SIX, **SEVEN, **SKEWED}
SIX_AND_MORE = {**SIX, **SEVEN, **SKEWED}
SMALL = np.array([0.02, -0.03, 0.01])
TURN = so3.exp(np.array([0.1, -0.2, 0.15]))


def every(arms: dict[str, Chain]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("chain", [pytest.param(c, id=name) for name, c in arms.items()])


@every(ARMS)
def test_ready_posture_is_inside_the_limits_and_regular(chain: Chain) -> None:
    session = session_of(chain)
    assert chain.within_limits(session.ready)
    assert singular_values(chain, session.ready)[-1] > 0.1


@pytest.mark.parametrize("name", ["px100", "ur5", "seven"])
def test_ready_posture_stands_up_in_front_of_the_base(
    name: str, urdf: Callable[[str], Path]
) -> None:
    arm = katana450.load(urdf(name))
    shoulder = arm.T_base_frame
    chain = arm.chain
    q = DrivenTool(chain).ready((), shoulder)
    T = shoulder @ forward(chain, q)
    # The elbow is over the shoulder, so that no link lies on the table.
    elbow = 3 if name == "seven" else 2
    w, v = np.split(chain.S[:, elbow], 2)
    height = (shoulder @ joint_frames(chain, q)[elbow] @ [*np.cross(w, v), 1.0])[2]
    assert height > shoulder[2, 3] + 0.08
    assert T[2, 3] > 0.5 * shoulder[2, 3]
    assert T[0, 3] > 2.0 * abs(T[1, 3])
    # One axis of the tool is vertical.
    assert np.abs(T[2, :3]).max() == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(q / math.radians(45.0), np.round(q / math.radians(45.0)), atol=1e-9)


TURNED_STEP = cmd.StepTool(np.array([0.0, 0.0, 0.0, 0.0, 0.1, 0.0]), JogFrame.TOOL)
MOVES: dict[str, Callable[[FloatArray], tuple[cmd.Command, FloatArray, FloatArray]]] = {
    "drag": lambda T: (cmd.Position(T[:3, 3] + SMALL), T[:3, 3] + SMALL, T[:3, :3]),
    "ring": lambda T: (cmd.Orient(TURN @ T[:3, :3]), T[:3, 3], TURN @ T[:3, :3]),
    "typed pose": lambda T: (cmd.Pose(moved(T)), T[:3, 3] + SMALL, TURN @ T[:3, :3]),
    "step": lambda T: (TURNED_STEP, T[:3, 3], T[:3, :3] @ so3.rotation_y(0.1)),
}
"""Commands, and the position [m] and rotation of the tool that they lead to from a pose."""


def moved(T: FloatArray) -> FloatArray:
    """Return the pose (4, 4) that is SMALL and TURN from the pose ``T``."""
    return se3.from_rotation_translation(TURN @ T[:3, :3], T[:3, 3] + SMALL)


@every(SIX_AND_MORE)
@pytest.mark.parametrize("name", MOVES)
def test_tool_is_moved_and_turned(chain: Chain, name: str) -> None:
    session, start, T = ready(chain)
    command, position, rotation = MOVES[name](T)
    state = settled(session, start, [command])
    reached = pose(session, state)
    np.testing.assert_allclose(reached[:3, 3], position, atol=1e-7)
    np.testing.assert_allclose(reached[:3, :3], rotation, atol=1e-6)
    assert (state.branch, state.status) == (start.branch, Status.OK)


@every(FOUR)
def test_four_axes_keep_the_pitch_in_a_drag(chain: Chain) -> None:
    session, start, T = ready(chain)
    aside = (exp(0.7 * chain.S[:, 0]) @ T)[:3, 3]
    state = settled(session, start, [cmd.Position(aside)])
    np.testing.assert_allclose(pose(session, state)[:3, 3], aside, atol=1e-7)
    # The tool is in the plane that turns with axis 1, so all other joints stay.
    np.testing.assert_allclose(state.q[1:], start.q[1:], atol=1e-6)
    assert state.status is Status.OK


def test_ring_pitches_four_axes() -> None:
    session, start, T = ready(OPENMANIPULATOR_X)
    pitched = so3.exp(0.2 * OPENMANIPULATOR_X.S[:3, 3]) @ T[:3, :3]
    state = settled(session, start, [cmd.Orient(pitched)])
    np.testing.assert_allclose(pose(session, state)[:3, :3], pitched, atol=1e-6)
    np.testing.assert_allclose(pose(session, state)[:3, 3], T[:3, 3], atol=1e-7)


@every(ARMS)
def test_pose_out_of_reach_has_its_reason_in_words(chain: Chain) -> None:
    session, start, T = ready(chain)
    T[:3, 3] = 10.0 * T[:3, 3]
    state = session.step(start, [cmd.Pose(T)], TICK)
    assert state.outcomes[0].verdict is Verdict.LIMITED
    assert state.findings[0].reason is Reason.OUT_OF_REACH
    assert "mm out of reach" in sentence(state)
    assert chain.within_limits(state.goal)


@every(ARMS)
def test_step_adds_up_along_the_tool(chain: Chain) -> None:
    session, start, T = ready(chain)
    step = cmd.StepTool(np.array([0.0, 0.0, 0.01, 0.0, 0.0, 0.0]))
    state = settled(session, run(session, start, [step]), [step])
    np.testing.assert_allclose(pose(session, state)[:3, 3], T[:3, 3] + (0, 0, 0.02), atol=1e-7)


@pytest.mark.cases(2)
@every(SIX_AND_MORE)
@pytest.mark.parametrize("frame", JogFrame)
def test_jog_follows_all_six_rates(chain: Chain, frame: JogFrame) -> None:
    session = session_of(chain)
    state = begun(session)
    rates = np.array([0.02, -0.01, 0.015, 0.03, 0.02, -0.04])
    for _ in range(60):
        state = run(session, state, [cmd.Jog(rates, frame)])
    before = pose(session, state)
    after = pose(session, run(session, state, [cmd.Jog(rates, frame)]))
    moved = (after[:3, 3] - before[:3, 3]) / TICK
    turned = so3.log(after[:3, :3] @ before[:3, :3].T) / TICK
    R = before[:3, :3] if frame is JogFrame.TOOL else np.eye(3)
    np.testing.assert_allclose(moved, R @ rates[:3], atol=1e-3)
    np.testing.assert_allclose(turned, R @ rates[3:], atol=2e-3)


@every(FOUR)
def test_jog_of_four_axes_moves_the_point_exactly(chain: Chain) -> None:
    session = session_of(chain)
    state = begun(session)
    rates = np.array([0.0, 0.02, 0.01, 0.0, 0.0, 0.0])
    for _ in range(60):
        state = run(session, state, [cmd.Jog(rates)])
    before = pose(session, state)
    after = pose(session, run(session, state, [cmd.Jog(rates)]))
    np.testing.assert_allclose((after - before)[:3, 3] / TICK, rates[:3], atol=1e-3)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (cmd.Jog(np.zeros(5)), "6 numbers"),
        (cmd.StepTool(np.zeros(5)), "6 numbers"),
        (cmd.Turn(0.1, 0.2), "give this tool a pose or a rotation"),
        (cmd.SetPriority(Priority.PITCH), "'pose', 'position', 'orientation'"),
        (cmd.Branch(name="left-up"), "left-up-noflip, left-up-flip, left-down-noflip"),
    ],
)
def test_command_of_five_axes_is_refused_with_what_works(
    command: cmd.Command, message: str
) -> None:
    session = session_of(UR5E)
    with pytest.raises(InputError, match=message):
        session.step(begun(session), [command], TICK)


@pytest.mark.parametrize(
    "command",
    [
        cmd.Position(np.array([1e308, -1e308, 0.0])),
        cmd.Pose(se3.from_rotation_translation(np.eye(3), np.array([1e160, 0.0, 0.0]))),
    ],
    ids=lambda command: type(command).__name__,
)
def test_number_whose_square_overflows_is_refused(command: cmd.Command) -> None:
    session = session_of(PANDA)
    with pytest.raises(InputError, match=r"give numbers up to 1e\+06"):
        session.step(begun(session), [command], TICK)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (cmd.Jog(np.zeros(6)), "5 numbers: x, y, z, pitch and roll"),
        (cmd.StepTool(np.zeros(6)), "5 numbers"),
        (cmd.Orient(np.eye(3)), "by a pitch and a roll"),
        (cmd.SetPriority(Priority.ORIENTATION), "'position and pitch'"),
        (cmd.Branch(name="left-up-noflip"), "front-up, front-down, back-up, back-down"),
    ],
)
def test_command_of_six_axes_is_refused_by_five(
    session: Session, command: cmd.Command, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        session.check(command)


@pytest.mark.parametrize("chain", [UR5E, PANDA], ids=["UR5e", "Panda"])
def test_other_branch_keeps_the_pose(chain: Chain) -> None:
    session, start, T = ready(chain)
    arm = session.require_arm()
    choices = session.choices(start)
    assert [choice.branch for choice in choices] == list(arm.kinematics.branches)
    usable = [
        choice
        for choice in choices
        if not choice.refusal and choice.position_error < 1e-6 and choice.branch != start.branch
    ]
    assert usable
    goal = with_branch(arm, start, usable[-1].branch).goal
    state = settled(session, start, [cmd.Follow(plan_to(arm, None, start, goal))])
    np.testing.assert_allclose(pose(session, state), T, atol=1e-6)
    assert state.branch == usable[-1].branch


@pytest.mark.parametrize("name", ["OpenMANIPULATOR-X", "PincherX-100", "Panda"])
def test_branch_that_the_limits_exclude_has_a_reason_and_is_refused_with_it(name: str) -> None:
    session = session_of(ARMS[name])
    arm, start = session.require_arm(), begun(session)
    refused = {choice.branch: choice.refusal for choice in session.choices(start)}
    assert refused[start.branch] == ""
    assert set(refused) == set(arm.kinematics.branches)
    for branch, why in refused.items():
        if not why:
            assert with_branch(arm, start, branch).branch == branch
            continue
        assert re.match(rf"The limits of ax[ie]s [1-7].* exclude the branch {branch}", why)
        with pytest.raises(InputError, match=f"exclude the branch {branch}"):
            with_branch(arm, start, branch)
    assert any(refused.values())


def test_priority_decides_what_is_kept_out_of_reach() -> None:
    session, start, T = ready(UR5E)
    far = cmd.Position(2.0 * T[:3, 3])
    lost = {}
    for priority in session.require_arm().kinematics.priorities:
        state = settled(session, start, [cmd.SetPriority(priority), far])
        reached = pose(session, state)
        lost[priority] = (
            float(np.linalg.norm(reached[:3, 3] - far.p)),
            so3.angle(reached[:3, :3], T[:3, :3]),
        )
    assert lost[Priority.ORIENTATION][1] < 1e-2
    assert lost[Priority.POSE][0] < lost[Priority.ORIENTATION][0] - 1e-3
    assert lost[Priority.POSITION][0] < lost[Priority.ORIENTATION][0] - 1e-3


def test_position_only_leaves_the_orientation_free() -> None:
    session = session_of(UR5E)
    start = begun(session)
    target = pose(session, start)[:3, 3] + (0.1, 0.2, 0.05)
    position_only: list[cmd.Command] = [cmd.SetPriority(Priority.POSITION), cmd.Position(target)]
    state = settled(session, start, position_only)
    np.testing.assert_allclose(pose(session, state)[:3, 3], target, atol=1e-6)
    assert state.status is Status.OK
