"""Test motions and objects that a program requests of a real server."""

from __future__ import annotations

import math
import time

import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.weight import loads_of
from katana450.client import Client, RefusedError
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.statics import holding_torques
from katana450.maths.kinematics.velocity import limit_distances, singular_values
from katana450.server.api import answers, requests
from katana450.server.api.fields import Matrix4
from tests.gateway.postures import READY, THERE


def test_program_moves_joints_and_waits_for_their_arrival(program: Client, arm: MountedArm) -> None:
    there = program.joints(THERE)
    assert there.status == "ok"
    assert there.why == ""
    np.testing.assert_allclose(there.q, THERE, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.array(there.T), forward(arm.chain, THERE), rtol=0, atol=1e-12)
    # The client of the test before may not have left yet; then this one has a number too.
    assert there.holder == program.welcome.name
    assert program.welcome.name.startswith("Test")
    described = program.query(answers.Arm)
    assert described.joints == list(arm.chain.names)
    np.testing.assert_array_equal(described.ready, READY)
    np.testing.assert_array_equal(described.T_base_shoulder, arm.T_base_shoulder)


@pytest.mark.parametrize("frame", list(requests.Frame))
def test_pose_can_be_in_either_frame(
    program: Client, arm: MountedArm, frame: requests.Frame
) -> None:
    T = forward(arm.chain, THERE)
    asked = T if frame is requests.Frame.SHOULDER else arm.T_base_shoulder @ T
    there = program.go(requests.Pose(T=asked.tolist(), frame=frame))
    np.testing.assert_allclose(np.array(there.T), T, rtol=0, atol=1e-9)
    p = asked[:3, 3] + [0.0, 0.0, 0.02]
    there = program.go(requests.Position(p=tuple(p), frame=frame))
    np.testing.assert_allclose(np.array(there.T)[:3, 3], T[:3, 3] + [0, 0, 0.02], rtol=0, atol=1e-9)
    assert there.pitch is not None
    there = program.go(requests.Turn(pitch=there.pitch, roll=0.25))
    assert there.roll == pytest.approx(0.25, abs=1e-12)


def test_unreachable_request_gives_the_reason(program: Client) -> None:
    there = program.go(requests.Position(p=(0.9, 0.0, 0.0)))
    assert there.status == "limited"
    assert there.findings[0].reason == "out of reach"
    assert there.findings[0].unit == "m"
    assert there.findings[0].amount == pytest.approx(
        0.9 - math.hypot(*np.array(there.T)[:3, 3]), abs=0.02
    )
    with pytest.raises(RefusedError, match="There is no tool 'spoon'; this arm has"):
        program.ask(requests.Tool(name="spoon"))
    with pytest.raises(RefusedError, match="5 joints, but the command has 3"):
        program.ask(requests.Joints(q=[0.0, 0.0, 0.0]))
    skewed = ((1.0, 0.0, 0.0, 0.3), (0.0, 1.0, 0.5, 0.0), (0.0, 0.0, 1.0, 0.0), (0, 0, 0, 1.0))
    with pytest.raises(RefusedError, match=r"[Rr]otation"):
        program.ask(requests.Pose(T=skewed))


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
    values = singular_values(arm.chain, q)
    assert state.margins.condition_number == pytest.approx(values[0] / values[-1])
    assert state.margins.manipulability == pytest.approx(values.prod())
    assert state.margins.clearance is not None
    assert state.margins.clearance > 0.005
    program.send(requests.Joints(q=THERE.tolist()))
    deadline = time.monotonic() + 5.0
    while (program.query(answers.State).tool_speed or 0.0) < 0.05:
        assert time.monotonic() < deadline


def test_condition_number_is_null_in_a_singularity(program: Client) -> None:
    stretched = program.go(requests.GoToZero()).margins
    assert stretched is not None
    assert stretched.condition_number is None
    assert stretched.smallest_singular_value < 1e-9
    assert stretched.manipulability < 1e-9


def test_other_branch_is_reached_on_a_clear_path(program: Client) -> None:
    program.joints(np.deg2rad((0.0, -68.0, 85.0, 40.0, 0.0)))
    there = program.go(requests.Branch(shoulder="front", elbow="down"))
    assert there.branch == ("front", "down")
    assert there.status == "ok"
    back = program.go(requests.Branch(shoulder="front", elbow="up"))
    assert back.branch == ("front", "up")


def _rows(T: npt.ArrayLike) -> Matrix4:
    rows: Matrix4 = msgspec.convert(np.asarray(T).tolist(), Matrix4)
    return rows


def test_objects_are_moved_touched_and_removed(program: Client) -> None:
    known = {each.name: each for each in program.query(answers.Objects).objects}
    assert set(known) == {"cup", "basin"}
    T = np.array(known["cup"].T)
    T[:2, 3] = (0.1, -0.45)
    program.ask(requests.Place(name="cup", T=_rows(T)))
    wall = np.eye(4)
    wall[:3, 3] = (0.25, 0.3, 0.0)
    program.ask(
        requests.Place(name="wall", T=_rows(wall), shape=requests.Shape.BOX, size=[0.05, 0.3, 0.5])
    )
    met = program.go(requests.Joint(axis=1, value=1.2))
    assert met.status == "blocked"
    assert "wall" in (met.findings[0].parts or ())
    assert "wall" in met.why
    program.ask(requests.Remove(name="wall"))
    assert program.go(requests.Joint(axis=1, value=1.2)).status == "ok"
    now = {each.name: each for each in program.query(answers.Objects).objects}
    assert set(now) == {"cup", "basin"}
    np.testing.assert_array_equal(now["cup"].T, T)
    beyond_the_table = T.copy()
    beyond_the_table[:2, 3] = (1.5, 0.0)
    for wrong in (
        requests.Place(name="ball", T=_rows(wall)),
        requests.Place(name="ball", T=_rows(wall), shape=requests.Shape.BOX, size=[0.1]),
        requests.Place(name="table", T=_rows(wall)),
        requests.Place(name="wrist_link", T=_rows(wall), shape=requests.Shape.SPHERE, size=[0.1]),
        requests.Place(name="cup", T=_rows(np.zeros((4, 4)))),
        requests.Place(name="cup", T=_rows(beyond_the_table)),
    ):
        with pytest.raises(RefusedError):
            program.ask(wrong)
    program.ask(requests.Place(name="cup", T=_rows(known["cup"].T)))
