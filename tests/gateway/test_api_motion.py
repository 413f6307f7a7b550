"""Motions by requests: joints, poses, nudges and streams, and what a state derives."""

from __future__ import annotations

import itertools
import math
import time

import numpy as np
import pytest
from msgspec import structs

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import Shape
from katana450.arm.control.state.state import Reason
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot, loads_of
from katana450.client import Client, RefusedError
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.statics import holding_torques
from katana450.maths.kinematics.velocity import limit_distances, singular_values
from katana450.server.api import answers, requests
from tests.gateway.postures import READY, THERE
from tests.gateway.virtual import VirtualServer


def test_program_moves_joints_and_waits_for_their_arrival(program: Client, arm: MountedArm) -> None:
    state = program.joints(THERE)
    assert state.status == "ok"
    assert state.why == ""
    np.testing.assert_allclose(state.q, THERE, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.array(state.T), forward(arm.chain, THERE), rtol=0, atol=1e-12)
    # The client of the test before may not have left yet; then this one has a number too.
    assert state.holder == program.welcome.name
    assert program.welcome.name.startswith("Test")
    described = program.query(answers.Arm)
    assert state.touch is not None
    fingers = [finger.finger for finger in state.touch.fingers]
    assert fingers == ["finger_right_link", "finger_left_link"]
    assert described.joints == list(arm.chain.names)
    np.testing.assert_array_equal(described.ready, READY)
    np.testing.assert_array_equal(described.T_base_shoulder, arm.T_base_shoulder)


@pytest.mark.parametrize("frame", list(requests.Frame))
def test_pose_can_be_in_either_frame(
    program: Client, arm: MountedArm, frame: requests.Frame
) -> None:
    T = forward(arm.chain, THERE)
    target = T if frame is requests.Frame.SHOULDER else arm.T_base_shoulder @ T
    state = program.go(requests.Pose(T=target, frame=frame))
    np.testing.assert_allclose(np.array(state.T), T, rtol=0, atol=1e-9)
    p = target[:3, 3] + [0.0, 0.0, 0.02]
    state = program.go(requests.Position(p=p, frame=frame))
    np.testing.assert_allclose(np.array(state.T)[:3, 3], T[:3, 3] + [0, 0, 0.02], rtol=0, atol=1e-9)
    assert state.pitch is not None
    state = program.go(requests.Turn(pitch=state.pitch, roll=0.25))
    assert state.roll == pytest.approx(0.25, abs=1e-12)


def test_unreachable_request_gives_the_reason(program: Client) -> None:
    state = program.go(requests.Position(p=np.array((0.9, 0.0, 0.0))))
    assert state.status == "limited"
    assert state.findings[0].reason == "out of reach"
    assert state.findings[0].unit == "m"
    assert state.findings[0].amount == pytest.approx(
        0.9 - math.hypot(*np.array(state.T)[:3, 3]), abs=0.02
    )
    with pytest.raises(RefusedError, match="There is no tool 'spoon'; this arm has"):
        program.ask(requests.Tool(name="spoon"))
    with pytest.raises(RefusedError, match="5 joints, but the command has 3"):
        program.ask(requests.Joints(q=np.array([0.0, 0.0, 0.0])))


def test_state_includes_values_derived_from_the_posture(
    program: Client, robot: Robot, arm: MountedArm
) -> None:
    q = THERE + np.array((0.3, 0.0, 0.0, 0.0, 0.0))
    program.joints(q)
    time.sleep(0.3)
    state = program.query(answers.State)
    assert state.sent > state.t + 0.2
    assert (state.setpoint, state.tool_speed) == (state.q, 0.0)
    assert (state.touching, state.held) == ([], None)
    assert state.holding == pytest.approx(holding_torques(arm.chain, q, loads_of(robot)))
    distances = limit_distances(arm.chain, q)
    assert state.margins is not None
    assert state.margins.limit == pytest.approx(distances.min())
    assert state.margins.axis == distances.argmin() + 1
    assert state.margins.limits == pytest.approx(distances.tolist())
    smallest = singular_values(arm.chain, q)[-1]
    assert state.margins.smallest_singular_value == pytest.approx(smallest)
    assert state.margins.clearance is not None
    assert state.margins.clearance > 0.005
    program.send(requests.Joints(q=THERE))
    deadline = time.monotonic() + 5.0
    while (program.query(answers.State).tool_speed or 0.0) < 0.05:
        assert time.monotonic() < deadline


def test_other_branch_is_reached_on_a_clear_path(program: Client) -> None:
    program.joints(np.deg2rad((0.0, -68.0, 85.0, 40.0, 0.0)))
    state = program.go(requests.Branch(name="front-down"))
    assert state.branch == ("front", "down")
    assert state.status == "ok"
    back = program.go(requests.Branch(name="front-up"))
    assert back.branch == ("front", "up")


def test_state_after_a_failed_planning_gives_the_reason(program: Client) -> None:
    start = program.joints(np.deg2rad((0.0, -68.0, 85.0, 40.0, 0.0)))
    T = np.eye(4)
    # It meets the arm in its goal, so that no long search for a path is waited for.
    T[:3, 3] = (0.2, 0.0, 0.32)
    program.ask(requests.Place(name="shelf", T=T, shape=requests.Shape.BOX, size=[0.3, 0.3, 0.1]))
    state = program.branch("back-up")
    assert "shelf" in state.why
    assert state.q == start.q
    assert program.joints(np.array(start.q)).why == ""


def test_objects_are_moved_touched_and_removed(program: Client) -> None:
    known = {item.name: item for item in program.query(answers.Objects).objects}
    assert set(known) == {"cup", "basin"}
    T = np.array(known["cup"].T)
    T[:2, 3] = (0.1, -0.45)
    program.ask(requests.Place(name="cup", T=T))
    wall = np.eye(4)
    wall[:3, 3] = (0.25, 0.3, 0.0)
    program.ask(
        requests.Place(name="wall", T=wall, shape=requests.Shape.BOX, size=[0.05, 0.3, 0.5])
    )
    state = program.go(requests.Joint(axis=1, value=1.2))
    assert state.status == "blocked"
    assert "wall" in (state.findings[0].parts or ())
    assert "wall" in state.why
    program.ask(requests.Remove(name="wall"))
    assert program.go(requests.Joint(axis=1, value=1.2)).status == "ok"
    now = {item.name: item for item in program.query(answers.Objects).objects}
    assert set(now) == {"cup", "basin"}
    np.testing.assert_array_equal(now["cup"].T, T)
    beyond_the_table = T.copy()
    beyond_the_table[:2, 3] = (1.5, 0.0)
    for wrong in (
        requests.Place(name="ball", T=wall),
        requests.Place(name="ball", T=wall, shape=requests.Shape.BOX, size=[0.1]),
        requests.Place(name="table", T=wall),
        requests.Place(name="wrist_link", T=wall, shape=requests.Shape.SPHERE, size=[0.1]),
        requests.Place(name="cup", T=np.zeros((4, 4))),
        requests.Place(name="cup", T=beyond_the_table),
    ):
        with pytest.raises(RefusedError):
            program.ask(wrong)
    program.ask(requests.Place(name="cup", T=np.array(known["cup"].T)))


def test_each_joint_names_its_link_and_the_way_to_it(program: Client, robot: Robot) -> None:
    links = program.query(answers.Arm).links
    arm = robot.require_arm()
    by_name = {link.name: link for link in robot.links}
    assert [link_path.label for link_path in links][:2] == ["1 base turn", "2 shoulder"]
    for link_path, name in zip(links, arm.chain.names, strict=True):
        link = by_name[link_path.path[-1]]
        assert link.joint is not None
        assert (link.joint.name, by_name[link_path.path[0]].parent) == (name, None)
        assert np.allclose(link_path.axis, link.joint.axis)
        for above, below in itertools.pairwise(link_path.path):
            assert by_name[below].parent == above


def test_nudges_of_one_tick_add_up(session: Session) -> None:
    before = session.begin(session.ready, 0.0, 0.0)
    commands: list[cmd.Command] = [cmd.Nudge(1, 0.1), cmd.Nudge(1, 0.1), cmd.Nudge(5, -0.2)]
    after = session.step(before, commands, 0.01)
    moved = np.array((0.2, 0.0, 0.0, 0.0, -0.2))
    np.testing.assert_allclose(after.goal, session.ready + moved, rtol=0, atol=1e-12)
    assert after.findings == ()


def test_nudge_is_limited_to_the_range_of_the_joint(session: Session) -> None:
    before = session.begin(session.ready, 0.0, 0.0)
    after = session.step(before, [cmd.Nudge(2, 9.0)], 0.01)
    assert after.goal[1] == session.require_arm().chain.upper[1]
    (finding,) = after.findings
    assert (finding.reason, finding.axis) == (Reason.AXIS_LIMIT, 1)
    # The next nudge counts from the limit, not from the requested angle beyond it.
    back = session.step(after, [cmd.Nudge(2, -0.1)], 0.02)
    assert back.goal[1] == pytest.approx(session.require_arm().chain.upper[1] - 0.1)
    assert back.findings == ()


def test_program_nudges_a_joint_of_a_real_server(program: Client) -> None:
    start = program.query(answers.State)
    state = program.nudge(1, 0.1)
    assert state.why == ""
    assert state.q[0] == pytest.approx(start.goal[0] + 0.1)
    assert state.q[1:] == pytest.approx(start.goal[1:])
    state = program.nudge(1, 10.0)
    assert "limit" in state.why
    assert state.q[0] == pytest.approx(program.query(answers.Arm).upper[0])
    answer = program.ask(requests.Nudge(axis=1, by=1.0))
    assert isinstance(answer, answers.Done)
    assert answer.outcome == "limited"
    assert [finding.reason for finding in answer.findings] == ["axis limit"]
    with pytest.raises(RefusedError, match="no axis 9"):
        program.nudge(9, 0.1)


def test_joint_stream_is_followed_and_ends_at_rest(program: Client) -> None:
    began = time.monotonic()
    while (t := time.monotonic() - began) < 1.5:
        wave = READY + math.sin(2.0 * t) * np.array((0.2, 0.0, 0.0, 0.0, 0.4))
        program.send(requests.Servo(q=wave))
        time.sleep(0.02)
    moving = program.query(answers.State)
    assert abs(np.array(moving.qd)[0]) > 0.05
    time.sleep(1.2)
    rest = program.query(answers.State)
    assert not rest.moving
    # The arm braked at once and did not continue to the last target of the stream.
    assert abs(rest.q[0] - 0.2 * math.sin(2.0 * 1.5)) < 0.2
    # A target of another kind stays until it is reached.
    state = program.joints(THERE)
    np.testing.assert_allclose(state.q, THERE, rtol=0, atol=1e-12)


def test_states_arrive_at_the_requested_rate(program: Client) -> None:
    times = []
    for state in program.states(hz=50.0):
        times.append(time.monotonic())
        assert len(state.q) == 5
        if len(times) == 60:
            break
    assert np.mean(np.diff(times)) == pytest.approx(0.02, abs=1e-3)


SLOW_WATCH = 0.1
"""[Hz] Rate of the states of a watcher that learns of a stop between them."""


def test_slow_watcher_learns_of_a_stop_at_once(local: VirtualServer, program: Client) -> None:
    program.ask(requests.Speed(value=0.2))
    program.ask(requests.Joints(q=THERE))
    with local.connect("Watcher") as watcher:
        states = watcher.states(SLOW_WATCH)
        next(states)
        began = time.monotonic()
        program.stop()
        while next(states).stop != "confirmed":
            pass
        assert time.monotonic() - began < 0.1
        program.clear_stop()
        while next(states).stopped is not None:
            pass
        # It can be cleared only at rest, and 1 s after it.
        assert time.monotonic() - began < 2.0


def test_printed_pose_is_accepted_and_its_rounding_reported(
    program: Client, arm: MountedArm
) -> None:
    T = forward(arm.chain, THERE)
    for decimals in (6, 5, 4):
        rounding = 0.5 * 10.0**-decimals
        printed = T.round(decimals)
        accepted = program.ask(requests.Pose(T=printed))
        assert isinstance(accepted, answers.Done)
        assert accepted.rotation_misfit is not None
        assert 1e-3 * rounding < accepted.rotation_misfit < 4.0 * rounding
        state = program.go(requests.Pose(T=printed))
        np.testing.assert_allclose(np.array(state.T), T, rtol=0, atol=10.0 * rounding)


def test_object_is_placed_near_a_point_of_the_table(program: Client) -> None:
    ball = requests.Place(name="near", shape=Shape.SPHERE, size=[0.02], can_be_held=True)
    program.ask(structs.replace(ball, near=(0.1, 0.5)))
    (placed,) = (item for item in program.query(answers.Objects).objects if item.name == "near")
    np.testing.assert_allclose(np.array(placed.T)[:3, 3], (0.1, 0.5, 0.0), rtol=0, atol=1e-9)
    program.ask(requests.Remove(name="near"))
    with pytest.raises(RefusedError, match="nothing carries it there"):
        program.ask(structs.replace(ball, near=(1.3, 1.3)))
