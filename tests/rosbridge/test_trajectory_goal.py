"""A checked goal becomes a script through its points, and keeps its tolerance of time."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from katana450.extensions.programs.script.script import parse
from katana450.extensions.rosbridge.goals import (
    MAX_POINTS,
    CheckedTrajectory,
    ErrorCode,
    GoalError,
)
from katana450.extensions.rosbridge.protocol import FollowJointTrajectory
from tests.rosbridge.ros_client import JOINTS, stamp, trajectory

START = np.array([0.0, -1.19, 1.48, 0.14, 0.0])


def checked(now: float = 0.0, **fields: object) -> CheckedTrajectory:
    points = fields.pop("points", ((1.0, [0.1] * 5), (2.0, [0.2] * 5)))
    goal = trajectory(*points, **fields)  # type: ignore[misc]
    return CheckedTrajectory.of(msgspec.convert(goal, FollowJointTrajectory), JOINTS, START, now)


def test_trajectory_begins_where_the_arm_stands() -> None:
    goal = checked()
    assert goal.times == pytest.approx([0.0, 1.0, 2.0])
    assert goal.postures[0] == pytest.approx(START)
    assert goal.moves
    # A first point at time 0 is where the arm stands, up to a tolerance.
    near = (START + 0.01).tolist()
    goal = checked(points=((0.0, near), (1.0, [0.1] * 5)))
    assert goal.postures[0] == pytest.approx(START)
    assert len(goal.times) == 2
    assert not checked(points=((1.0, START.tolist()),)).moves


def test_longest_script_is_short_enough() -> None:
    points = tuple((0.85 * k + 0.1234, [-2.345678] * 5) for k in range(1, MAX_POINTS + 1))
    script = parse(checked(points=points).script("ROS trajectory 1"))
    assert script.name == "ROS trajectory 1"
    assert len(script.steps) == 1


def test_tolerance_of_the_time_is_kept() -> None:
    goal = checked(goal_time_tolerance=stamp(0.5))
    goal.check_time(2.4)
    with pytest.raises(GoalError) as refused:
        goal.check_time(2.6)
    assert refused.value.code is ErrorCode.GOAL_TOLERANCE_VIOLATED
    assert checked().time_tolerance == math.inf


def test_start_time_is_now_or_refused() -> None:
    def at(sec: int) -> CheckedTrajectory:
        goal = trajectory((1.0, [0.1] * 5))
        goal["trajectory"]["header"] = {"stamp": {"sec": sec}}
        converted = msgspec.convert(goal, FollowJointTrajectory)
        return CheckedTrajectory.of(converted, JOINTS, START, 1000.5)

    at(0)
    at(1000)
    for sec, code in ((990, ErrorCode.OLD_HEADER_TIMESTAMP), (1010, ErrorCode.INVALID_GOAL)):
        with pytest.raises(GoalError) as refused:
            at(sec)
        assert refused.value.code is code


@pytest.mark.parametrize(
    ("name", "value"),
    [("velocities", [0.1] * 4), ("accelerations", [0.1]), ("effort", [1.0] * 5)],
)
def test_lists_of_a_wrong_length_and_efforts_are_refused(name: str, value: list[float]) -> None:
    goal = trajectory((1.0, [0.1] * 5))
    goal["trajectory"]["points"][0][name] = value
    with pytest.raises(GoalError, match="Point 1 has"):
        CheckedTrajectory.of(msgspec.convert(goal, FollowJointTrajectory), JOINTS, START, 0.0)


def test_motion_at_the_end_is_refused() -> None:
    goal = trajectory((1.0, [0.1] * 5))
    goal["trajectory"]["points"][0]["velocities"] = [0.0, 0.5, 0.0, 0.0, 0.0]
    with pytest.raises(GoalError, match="last point are not 0"):
        CheckedTrajectory.of(msgspec.convert(goal, FollowJointTrajectory), JOINTS, START, 0.0)
