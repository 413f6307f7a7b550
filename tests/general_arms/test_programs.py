"""Scripts for arms outside the five-axis family: places, lines, arcs, circles and screws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.moves import Home, Joints, Move, Nudge, Via
from katana450.extensions.programs.plan_builder import PlanBuilder, PlanContext, UntimedPath
from katana450.extensions.programs.pose_path import PosePath
from katana450.extensions.programs.program import Program, compiled
from katana450.extensions.programs.runner import Phase, Run, step
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.source import ScriptError
from katana450.extensions.programs.step_target import Angles, StepTarget
from katana450.extensions.recording.codec import Codec, json_form, json_text
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import joint_derivatives
from katana450.maths.planning.plan import Plan
from tests.general_arms.driven import TICK, begun, pose, session_of, settled
from tests.general_arms.published_arms import (
    IIWA_7,
    KR_6,
    OPENMANIPULATOR_X,
    PANDA,
    PINCHERX_100,
    PUMA_560,
    QUARTER,
    SKEWED_6,
    SKEWED_7,
    UR5E,
    craig,
)

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


def builder(chain: Chain) -> PlanBuilder:
    session = session_of(chain)
    return PlanBuilder(PlanContext(session, np.eye(4)), begun(session))


def program(chain: Chain, *steps: str) -> Program:
    """Return the steps as a program from the ready posture."""
    made = builder(chain)
    text = "frame: base\nsteps:\n" + "".join(f"  - {each}\n" for each in steps)
    return compiled(parse(text), made.plan_context, made.state)


def plans(made: Program) -> list[Plan]:
    return [each.action.plan for each in made.tasks if isinstance(each.action, FollowPlan)]


def played(chain: Chain, made: Program) -> list[State]:
    """Return the states of a run to its end."""
    session = session_of(chain)
    state, run = begun(session), Run(0.0)
    states = [state]
    while run.phase is Phase.RUNNING and len(states) < 4000:
        run, commands = step(made, run, state, state.t)
        state = session.step(state, commands, state.t + TICK)
        state = session.observe(state, state.setpoint, 0.0)
        states.append(state)
    assert (run.phase, run.why) == (Phase.DONE, "")
    return states


def on_paths(states: list[State]) -> list[tuple[PosePath, float, FloatArray]]:
    """Return path, place and joints of each tick on a path of the tool."""
    found = []
    for state in states:
        following = state.following
        if following is not None and isinstance(following.segment.path, PosePath):
            sigma = following.segment.scaling.pace(following.local).sigma
            found.append((following.segment.path, sigma, state.setpoint))
    return found


def middle(chain: Chain) -> FloatArray:
    """Return the tool point (3,) [mm] of the ready posture."""
    made = builder(chain)
    return 1e3 * made.target.position


def length(chain: Chain) -> float:
    """Return a length [mm] that the arm can move its tool in every direction."""
    return 25.0 if chain.n == 4 else 80.0


def angles_beside(chain: Chain, turn: tuple[float, float, float]) -> str:
    """Return fields with the angles of the ready posture, turned by a rotation vector [rad]."""
    R = pose(session_of(chain), begun(session_of(chain)))[:3, :3]
    return angles_of(so3.exp(np.array(turn)) @ R)


def angles_of(R: FloatArray) -> str:
    roll, pitch, yaw = np.degrees(so3.to_rpy(R)).tolist()
    return f"roll: {roll!r}, pitch: {pitch!r}, yaw: {yaw!r}"


def point(p: FloatArray) -> str:
    return "{{x: {:.6f}, y: {:.6f}, z: {:.6f}}}".format(*p)


@every(SOME, REST)
def test_move_to_a_point_keeps_the_orientation_and_is_followed(chain: Chain) -> None:
    made = builder(chain)
    session = made.plan_context.session
    start = made.state
    T = pose(session, start)
    there = T[:3, 3] + (0.0, 0.02, -0.02)
    Move(StepTarget(position=there)).build(made)
    _, untimed = made.actions[-1]
    assert isinstance(untimed, UntimedPath)
    reached = pose(session, settled(session, start, [cmd.Follow(untimed.timed().plan)]))
    np.testing.assert_allclose(reached[:3, 3], there, atol=1e-6)
    if chain.n >= 6:
        assert so3.angle(reached[:3, :3], T[:3, :3]) < 1e-6


@every(SOME, {})
def test_joints_nudge_via_and_home_are_planned(chain: Chain) -> None:
    made = builder(chain)
    q = np.array(made.q)
    turned = q + 0.1
    Joints(turned).build(made)
    np.testing.assert_allclose(made.q, turned, atol=1e-9)
    Nudge(0, -0.2).build(made)
    assert made.q[0] == pytest.approx(turned[0] - 0.2)
    Via((StepTarget(joints=q + 0.05), StepTarget(joints=q - 0.05)), 0.5).build(made)
    np.testing.assert_allclose(made.q, q - 0.05, atol=1e-9)
    Home().build(made)
    np.testing.assert_allclose(made.q, q, atol=1e-9)


@every(SOME, REST)
def test_line_is_straight_and_keeps_the_orientation_at_every_tick(chain: Chain) -> None:
    made = program(chain, f"line: {{by: {{y: {length(chain)}, z: {-0.5 * length(chain)}}}}}")
    states = played(chain, made)
    start = forward_batch(chain, states[0].setpoint[None])[0]
    end = forward_batch(chain, states[-1].setpoint[None])[0]
    by = 1e-3 * length(chain) * np.array((0.0, 1.0, -0.5))
    np.testing.assert_allclose(end[:3, 3] - start[:3, 3], by, atol=NANOMETRE)
    direction = by / np.linalg.norm(by)
    ticks = on_paths(states)
    assert len(ticks) > 30
    for T, (path, sigma, q) in zip(
        forward_batch(chain, np.array([q for *_, q in ticks])), ticks, strict=True
    ):
        off = T[:3, 3] - start[:3, 3]
        assert np.linalg.norm(off - (off @ direction) * direction) < NANOMETRE
        if chain.n >= 6:
            assert so3.angle(T[:3, :3], start[:3, :3]) < 1e-9
        else:
            assert path.turned_off(np.array([sigma]), q[None])[0] < 1e-9
    # Half-way between two ticks a drive that moves straight in its joints is beside the line.
    q = np.array([q for *_, q in ticks])
    off = forward_batch(chain, 0.5 * (q[:-1] + q[1:]))[:, :3, 3] - start[:3, 3]
    assert np.linalg.norm(off - np.outer(off @ direction, direction), axis=1).max() < 1e-4


@every(SOME, REST)
def test_run_keeps_the_limits_of_every_joint(chain: Chain) -> None:
    made = program(chain, f"line: {{by: {{y: {length(chain)}}}}}", "home")
    q = np.array([state.setpoint for state in played(chain, made)])
    limits = session_of(chain).require_arm().limits
    bounds = (limits.speed, limits.acceleration, limits.jerk)
    for order, most in enumerate(bounds, start=1):
        assert (np.abs(np.diff(q, order, axis=0)) / TICK**order / most).max() <= 1.0 + 1e-6


@every(SOME, REST)
@pytest.mark.parametrize("normal", ["x", "[0.2, 1, 1]"])
def test_circle_closes_in_the_tool_and_in_the_joints(chain: Chain, normal: str) -> None:
    radius = 0.4 * length(chain)
    centre = point(middle(chain) - (radius, 0.0, 0.0))
    made = program(chain, f"circle: {{centre: {centre}, normal: {normal}, radius: {radius}}}")
    path = plans(made)[-1].segments[0].path
    assert isinstance(path, PosePath)
    np.testing.assert_allclose(path.end, path.start, atol=1e-9)
    sigma = np.linspace(0.0, 1.0, 777)
    q = joint_derivatives(path, sigma)[0]
    T = forward_batch(chain, q)
    off = T[:, :3, 3] - 1e-3 * (middle(chain) - (radius, 0.0, 0.0))
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), 1e-3 * radius, atol=NANOMETRE)
    axis = np.array((1.0, 0.0, 0.0)) if normal == "x" else np.array((0.2, 1.0, 1.0))
    np.testing.assert_allclose(off @ axis, 0.0, atol=NANOMETRE)
    assert path.turned_off(sigma, q).max() < 1e-9


@every(SOME, REST)
def test_derivatives_of_the_joints_are_exact(chain: Chain) -> None:
    angles = "" if chain.n < 6 else f", {angles_beside(chain, (0.1, -0.1, 0.2))}"
    made = program(chain, f"line: {{by: {{x: {-0.5 * length(chain)}}}{angles}}}")
    path = plans(made)[-1].segments[0].path
    sigma = np.linspace(0.05, 0.95, 9)
    h = 1e-3
    q, first, second, third = joint_derivatives(path, sigma)
    ahead, behind = (joint_derivatives(path, sigma + step) for step in (h, -h))
    np.testing.assert_allclose(first, (ahead[0] - behind[0]) / (2 * h), atol=1e-4)
    np.testing.assert_allclose(second, (ahead[1] - behind[1]) / (2 * h), atol=1e-3)
    np.testing.assert_allclose(third, (ahead[2] - behind[2]) / (2 * h), atol=2e-2)
    np.testing.assert_allclose(q, (ahead[0] + behind[0]) / 2 - h * h / 2 * second, atol=1e-8)


@every({"UR5e": UR5E, "KR 6": KR_6, "Panda": PANDA}, {"skewed 6": SKEWED_6})
def test_pose_with_an_orientation_is_taken_and_the_line_turns_to_it(chain: Chain) -> None:
    T = pose(session_of(chain), begun(session_of(chain)))
    R = so3.exp(np.array((0.1, -0.2, 0.15))) @ T[:3, :3]
    angles = angles_of(R)
    p = middle(chain) - (0.4 * length(chain), 10.0, 10.0)
    for text in (f"move: {point(p)[:-1]}, {angles}}}", f"line: {{to: {point(p)}, {angles}}}"):
        reached = forward_batch(chain, plans(program(chain, text))[-1].end[None])[0]
        np.testing.assert_allclose(reached[:3, 3], 1e-3 * p, atol=2e-9)
        np.testing.assert_allclose(reached[:3, :3], R, atol=1e-9)
    # On the line the tool turns about one axis, evenly.
    path = plans(program(chain, text))[-1].segments[0].path
    half = forward_batch(chain, joint_derivatives(path, np.array([0.5]))[0])[0]
    expected = so3.exp(0.5 * so3.log(R @ T[:3, :3].T)) @ T[:3, :3]
    np.testing.assert_allclose(half[:3, :3], expected, atol=1e-9)


@every({"UR5e": UR5E}, {"KR 6": KR_6, "Panda": PANDA})
def test_one_angle_changes_and_the_others_stay(chain: Chain) -> None:
    before = so3.to_rpy(pose(session_of(chain), begun(session_of(chain)))[:3, :3])
    end = plans(program(chain, f"line: {{yaw: {math.degrees(before[2]) + 15.0}}}"))[-1].end
    after = so3.to_rpy(forward_batch(chain, end[None])[0][:3, :3])
    np.testing.assert_allclose(after[:2], before[:2], atol=1e-9)
    assert after[2] - before[2] == pytest.approx(math.radians(15.0), abs=1e-9)


def test_four_axes_have_a_pitch_wherever_the_tool_goes() -> None:
    chain = OPENMANIPULATOR_X
    p = middle(chain) - (20.0, -60.0, 20.0)
    # The frame of this tool lies on its side and turns about its y axis.
    now = so3.to_rpy(pose(session_of(chain), begun(session_of(chain)))[:3, :3])
    made = program(chain, f"move: {point(p)[:-1]}, pitch: 25}}", "line: {by: {y: -40}, pitch: 5}")
    one, two = (forward_batch(chain, each.end[None])[0] for each in plans(made))
    np.testing.assert_allclose(one[:3, 3], 1e-3 * p, atol=2e-9)
    np.testing.assert_allclose(two[:3, 3] - one[:3, 3], (0.0, -0.04, 0.0), atol=2e-9)
    for T, pitch in ((one, 25.0), (two, 5.0)):
        roll, found, _ = so3.to_rpy(T[:3, :3])
        assert math.degrees(found) == pytest.approx(pitch, abs=1e-6)
        assert abs(math.remainder(roll - now[0], math.tau)) < 1e-9


@every(SOME, {})
def test_lines_arc_and_screw_are_planned(chain: Chain) -> None:
    p, d = middle(chain), 0.3 * length(chain)
    corners = [p - (0.0, -d, 0.0), p - (0.0, -d, d), p - (0.0, 0.0, d)]
    made = program(
        chain,
        f"lines: {{through: [{', '.join(map(point, corners))}]}}",
        f"lines: {{through: [{point(p)}, {point(corners[0])}], blend: 0}}",
        f"arc: {{centre: {point(p)}, axis: x, angle: 45, climb: 5}}",
        "home",
    )
    blended = plans(made)[0].segments[0].path
    np.testing.assert_allclose(
        forward_batch(chain, blended.end[None])[0, :3, 3], 1e-3 * corners[-1], atol=2e-9
    )
    assert isinstance(blended, PosePath)
    assert len(blended.joins) >= 4
    assert len(plans(made)[1].segments) == 2
    # The corner is rounded: the path passes beside it.
    sigma = np.linspace(0.0, 1.0, 1000)
    points = 1e3 * forward_batch(chain, joint_derivatives(blended, sigma)[0])[:, :3, 3]
    beside = np.linalg.norm(points - corners[0], axis=1).min()
    assert 0.02 * d < beside < 0.3 * d
    end = forward_batch(chain, plans(made)[2].end[None])[0, :3, 3]
    turn = so3.rotation_x(math.radians(45.0)) @ (corners[0] - p)
    np.testing.assert_allclose(1e3 * end, p + turn + (5.0, 0.0, 0.0), atol=1e-5)


@every({"UR5e": UR5E, "Panda": PANDA}, {"KR 6": KR_6})
def test_screw_moves_the_tool_as_one_rigid_body(chain: Chain) -> None:
    beside = point(middle(chain) - (0.0, 0.0, 50.0))
    made = program(chain, f"screw: {{point: {beside}, axis: z, angle: 30, climb: 8}}")
    before = pose(session_of(chain), begun(session_of(chain)))
    after = forward_batch(chain, plans(made)[0].end[None])[0]
    turn = so3.rotation_z(math.radians(30.0))
    np.testing.assert_allclose(after[:3, :3], turn @ before[:3, :3], atol=1e-9)
    np.testing.assert_allclose(after[:3, 3], before[:3, 3] + (0.0, 0.0, 0.008), atol=2e-9)


@every({"UR5e": UR5E, "OpenMANIPULATOR-X": OPENMANIPULATOR_X}, {"KR 6": KR_6, "Panda": PANDA})
def test_line_beyond_the_reach_is_refused_with_the_place_and_what_works(chain: Chain) -> None:
    with pytest.raises(ScriptError) as refused:
        program(chain, "line: {by: {x: 1900}}")
    text = str(refused.value)
    assert "% along it, at (" in text
    assert "mm in the base frame" in text
    assert "mm out of reach, because its links reach no farther" in text
    remedy = text.split("as far as `")[1].split("`", maxsplit=1)[0]
    assert plans(program(chain, f"line: {{{remedy}}}"))


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
    made, _, _ = run_from(chain, q, f"move: {to}")
    reached = forward_batch(chain, plans(made)[-1].end[None])[0]
    np.testing.assert_allclose(reached, end, atol=1e-8)


def test_line_beside_a_singularity_turns_the_wrist_within_its_limits() -> None:
    # The wrist passes 4 degrees beside its singularity, where axes 4 and 6 turn by 140 degrees.
    chain, q = KR_6, np.array((0.2, -1.0, 1.2, 0.3, 0.25, 0.1))
    other = q + np.array((0.0, 0.0, 0.0, 2.5, 0.0, -2.5))
    end = forward_batch(chain, other[None])[0]
    text = f"line: {{to: {point(1e3 * end[:3, 3])}, {angles_of(end[:3, :3])}}}"
    made, state, _ = run_from(chain, q, text)
    path = plans(made)[0].segments[0].path
    assert abs(path.end[3] - path.start[3]) > 2.4
    session = session_of(chain)
    run, setpoints = Run(0.0), [state.setpoint]
    while run.phase is Phase.RUNNING and len(setpoints) < 4000:
        run, commands = step(made, run, state, state.t)
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
    made, rng, found = builder(chain), np.random.default_rng(4), 0
    kinematics = made.plan_context.arm.kinematics
    for _ in range(12):
        start = made.target
        assert isinstance(start, ToolPose)
        end = start.moved(start.position + rng.normal(size=3) * 2.5e-3 * length(chain))
        if chain.n >= 6:
            end = replace(end, R=so3.exp(0.6 * rng.normal(size=3)) @ start.R)
        curve = made.planning.line(made.target, end)
        try:
            path = made.planning.path(made.state, made.q, curve, kinematics.branch_of(made.q))
        except InputError:
            continue
        found += 1
        for q in joint_derivatives(path, np.linspace(0.0, 1.0, 40))[0]:
            assert kinematics.branch_of(q) == kinematics.branch_of(path.start)
            assert chain.within_limits(q)
    assert found > 0


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
        (OPENMANIPULATOR_X, "move: {by: {z: 5}, roll: 45}", "turn it in one plane"),
        (OPENMANIPULATOR_X, "screw: {point: [0, 0, 0], axis: z, angle: 5}", "this one has 4"),
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
    text = "frame: base\nsteps:\n  - screw: {point: [0, 0, 0], axis: z, angle: -40}\n"
    state = session.begin(q, 0.0, 0.0)
    # The whole arm turns about axis 1 here; then the last axis turns about itself beyond its limit.
    compiled(parse(text), context, state)
    T = pose(session, state)
    roll, pitch, yaw = np.degrees(so3.to_rpy(T[:3, :3] @ so3.rotation_z(0.5))).tolist()
    text = f"frame: base\nsteps:\n  - line: {{roll: {roll}, pitch: {pitch}, yaw: {yaw}}}\n"
    with pytest.raises(ScriptError, match=r"axis 6, joint6, over its limit of 350.0 deg \d+.* %"):
        compiled(parse(text), context, state)


def test_swivel_of_seven_axes_turns_where_it_must() -> None:
    # With the swivel at a limit of the way, the line is possible only if it turns.
    path = plans(program(PANDA, "line: {by: {x: 280}}"))[0].segments[0].path
    end = forward_batch(PANDA, path.end[None])[0, :3, 3]
    np.testing.assert_allclose(1e3 * end, middle(PANDA) + np.array((280.0, 0, 0)), atol=1e-5)
    assert abs(path.end[6] - path.start[6]) > math.radians(10.0)
    assert PANDA.within_limits(path.end)


@every({"UR5e": UR5E, "OpenMANIPULATOR-X": OPENMANIPULATOR_X}, {"Panda": PANDA})
def test_trajectory_of_all_joints_is_followed(chain: Chain) -> None:
    q = np.degrees(builder(chain).q)
    rows = [[0.5 * number, *(q + 5.0 * number).tolist()] for number in range(4)]
    made = program(chain, f"trajectory: {{through: {rows}}}")
    np.testing.assert_allclose(played(chain, made)[-1].setpoint, np.radians(q + 15.0), atol=1e-9)


THREE_AXES = craig(
    [
        (0.0, 0.0, 0.1, 0.0),
        (-QUARTER, 0.0, 0.0, -0.5),
        (0.0, 0.15, 0.0, 1.0),
    ],
    [-3.0, -2.0, -2.0],
    [3.0, 2.0, 2.0],
    se3.from_rotation_translation(np.eye(3), np.array((0.12, 0.0, 0.0))),
)
EIGHT_AXES = craig(
    [
        (0.0, 0.0, 0.3, 0.1),
        (1.2, 0.05, 0.1, 0.0),
        (0.7, 0.3, -0.09, 0.0),
        (0.9, -0.02, 0.4, 0.0),
        (-1.0, 0.03, 0.1, 0.0),
        (0.7, 0.05, 0.06, 0.0),
        (1.2, 0.05, 0.1, 0.0),
        (0.8, 0.05, 0.1, 0.0),
    ],
    [-2.0] * 8,
    [2.0] * 8,
)


@pytest.mark.parametrize("chain", [THREE_AXES, EIGHT_AXES], ids=["three axes", "eight axes"])
def test_arm_of_few_or_many_axes_follows_lines_and_circles(chain: Chain) -> None:
    p = middle(chain)
    text = f"circle: {{centre: {point(p - (0.0, 0.0, 15.0))}, normal: x, radius: 15}}"
    made = program(chain, "line: {by: {y: 20}}", "line: {by: {y: -20}}", text)
    line, _, circle = (each.segments[0].path for each in plans(made))
    sigma = np.linspace(0.0, 1.0, 300)
    points = 1e3 * forward_batch(chain, joint_derivatives(line, sigma)[0])[:, :3, 3]
    np.testing.assert_allclose(points, p + np.outer(sigma, (0.0, 20.0, 0.0)), atol=1e-6)
    np.testing.assert_allclose(circle.end, circle.start, atol=1e-9)
    np.testing.assert_allclose(circle.end, builder(chain).q, atol=1e-8)


def test_three_axes_choose_no_orientation() -> None:
    with pytest.raises(ScriptError, match="3 axes follows from its position"):
        program(THREE_AXES, "line: {pitch: 5}")


def test_grasping_needs_a_pitch_and_a_roll() -> None:
    with pytest.raises(InputError, match="five-axis arm"):
        _ = builder(UR5E).at


@every({"UR5e": UR5E}, {"Panda": PANDA, "OpenMANIPULATOR-X": OPENMANIPULATOR_X})
def test_plan_is_recorded_to_the_bit(chain: Chain) -> None:
    d, p = 0.3 * length(chain), middle(chain)
    through = ", ".join(map(point, (p - (0.0, 0.0, d), p - (0.0, d, d))))
    made = program(chain, f"line: {{by: {{y: {d}}}}}", f"lines: {{through: [{through}]}}")
    writer, reader, session = Codec(), Codec(), session_of(chain)
    states: list[list[bytes]] = [[], []]
    for plan in plans(made):
        form = json_text(writer.encoded(cmd.Follow, cmd.Follow(plan)))
        for shared in writer.shared.take_new():
            reader.shared.add(shared)
        found = reader.decoded(cmd.Follow, json_form(form))
        for command, seen in zip((cmd.Follow(plan), found), states, strict=True):
            state = session.begin(plan.start, 0.0, 0.0)
            for number in range(60):
                commands = [command] if number == 0 else []
                state = session.step(state, commands, state.t + TICK)
                state = session.observe(state, state.setpoint, 0.0)
                seen.append(state.setpoint.tobytes())
                assert writer.encoded(State, state)
        assert found.plan.segments[0].path.joins == plan.segments[0].path.joins
    assert states[0] == states[1]
    assert len(set(states[0])) > 60


def test_path_refuses_numbers_that_are_no_path() -> None:
    path = plans(program(UR5E, "line: {by: {y: 20}}"))[0].segments[0].path
    assert isinstance(path, PosePath)
    for places, terms, message in (
        (path.places[::-1], path.terms, "must rise from 0 to 1"),
        (path.places[:-1], path.terms, "shape"),
        (path.places, path.terms * np.nan, "nan"),
    ):
        with pytest.raises(InputError, match=message):
            PosePath(path.chain, path.curve, places, terms)


def test_angles_that_gimbal_lock_hides_are_asked_for() -> None:
    made = builder(UR5E)
    target = made.planning.oriented(made.target, Angles(math.pi / 2, 0.0, 0.0), np.eye(3))
    with pytest.raises(InputError, match="`roll`, `pitch` and `yaw` together"):
        made.planning.oriented(target, Angles(yaw=0.3), np.eye(3))
    assert made.planning.oriented(target, Angles(), np.eye(3)) is target


def test_curve_is_the_same_for_one_place_and_for_many() -> None:
    path = (
        plans(program(UR5E, f"line: {{{angles_beside(UR5E, (0.1, 0.1, 0.1))}}}"))[0]
        .segments[0]
        .path
    )
    assert isinstance(path, PosePath)
    sigma = np.linspace(0.0, 1.0, 5)
    many = path.curve.at(Jet.variable(sigma)).T
    for number, each in enumerate(sigma.tolist()):
        np.testing.assert_allclose(path.curve.at(Jet.variable(each)).T[0], many[number], atol=1e-15)
