"""A mechanism driven joint by joint, with the limits, stops and streams of an arm."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.arm import JointSet
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import Reason, State, Status
from katana450.errors import InputError
from tests.ticks import during, rested

DT = 0.01

JOINTS = JointSet(
    names=("rail", "turn", "grip"),
    slides=(True, False, False),
    lower=np.array((0.05, -math.pi, -0.4)),
    upper=np.array((0.4, math.pi, 0.3)),
    speed=np.array((0.3, 2.0, 1.0)),
    why="It is a gantry.",
)


@pytest.fixture
def session() -> Session:
    return Session(JOINTS, JOINTS.ready, travel=lambda a, b: float(np.abs(a - b).max()))


@pytest.fixture
def state(session: Session) -> State:
    return session.begin(JOINTS.ready, 0.0, 0.0)


def test_session_begins_at_the_posture_nearest_to_zero(state: State) -> None:
    np.testing.assert_array_equal(state.q, (0.05, 0.0, 0.0))
    assert (state.status, state.moving, state.tool) == (Status.OK, False, "")


def test_clamped_value_is_reported_in_its_unit(session: Session, state: State) -> None:
    end = during(session, state, DT, cmd.SetAxes(((1, 9.0), (2, 9.0), (3, 0.1))))[-1]
    findings = [(f.reason, f.axis, f.amount) for f in end.findings]
    assert findings == [(Reason.SLIDE_LIMIT, 0, 0.4), (Reason.AXIS_LIMIT, 1, math.pi)]
    assert end.status is Status.LIMITED
    assert rested(session, end, cmd.SetAxes(((1, 0.1), (2, 0.0)))).findings == ()


def test_stop_takes_the_reported_distance_and_holds_until_cleared(
    session: Session, state: State
) -> None:
    moving = during(session, state, 0.8, cmd.Joints(np.array((0.4, 3.0, 0.3))))[-1]
    stopped = during(session, moving, DT, cmd.Stop())[-1]
    assert stopped.stopped is not None
    rest = during(session, stopped, stopped.stopped.time)[-1]
    assert rest.motion.at_rest
    np.testing.assert_allclose(rest.q, stopped.goal, rtol=0, atol=1e-9)
    far = np.abs(moving.setpoint - rest.q).max()
    assert stopped.stopped.way == pytest.approx(far, abs=1e-9)
    ignored = during(session, rest, 0.5, cmd.Home(), cmd.Speed(0.5))[-1]
    np.testing.assert_array_equal(ignored.q, rest.q)
    assert ignored.speed == 0.5
    free = during(session, ignored, 0.5, cmd.ClearStop())[-1]
    assert (free.stopped, free.findings, free.moving) == (None, (), False)
    home = rested(session, free, cmd.Home())
    np.testing.assert_array_equal(home.q, JOINTS.ready)


@pytest.mark.parametrize(
    "command",
    [
        cmd.Pose(np.eye(4)), cmd.Position(np.zeros(3)), cmd.Turn(0.0, 0.0),
        cmd.Tool("tcp"), cmd.Gripper(0.1), cmd.Jog(np.full(5, 0.1)),
        cmd.Batch((cmd.Home(), cmd.Gripper(0.0))),
    ],
)  # fmt: skip
def test_tool_command_without_an_arm_is_refused_with_the_reason(
    session: Session, state: State, command: cmd.Command
) -> None:
    with pytest.raises(InputError, match=r"Only its joints can be driven\. It is a gantry"):
        session.step(state, [command], DT)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (cmd.Joint(4, 0.0), "axis 4: the robot has 3"),
        (cmd.SetAxes(((1, 0.1), (8, 0.0))), "axis 8"),
        (cmd.Joints(np.zeros(5)), "3 driven joints, but the command has 5"),
        (cmd.Servo(np.zeros(2)), "3 driven joints, but the command has 2"),
    ],
)
def test_command_for_other_joints_is_refused(
    session: Session, command: cmd.Command, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        session.check(command)
