"""Test ``nudge``, a relative motion of one joint, as command, request and script step."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.session import Session
from katana450.arm.control.state import Reason
from katana450.client import Client, RefusedError
from katana450.errors import InputError
from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.plan_builder import PlanContext
from katana450.extensions.programs.program import compiled
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.source import ScriptError
from katana450.server.api import answers, requests


def test_nudges_of_one_tick_add_up(session: Session) -> None:
    before = session.begin(session.ready, 0.0, 0.0)
    given: list[cmd.Command] = [cmd.Nudge(0, 0.1), cmd.Nudge(0, 0.1), cmd.Nudge(4, -0.2)]
    after = session.step(before, given, 0.01)
    moved = np.array((0.2, 0.0, 0.0, 0.0, -0.2))
    np.testing.assert_allclose(after.goal, session.ready + moved, rtol=0, atol=1e-12)
    assert after.findings == ()


def test_nudge_is_limited_to_the_range_of_the_joint(session: Session) -> None:
    before = session.begin(session.ready, 0.0, 0.0)
    after = session.step(before, [cmd.Nudge(1, 9.0)], 0.01)
    assert after.goal[1] == session.require_arm().chain.upper[1]
    (found,) = after.findings
    assert (found.reason, found.axis) == (Reason.AXIS_LIMIT, 1)
    # The next nudge counts from the limit, not from the requested angle beyond it.
    back = session.step(after, [cmd.Nudge(1, -0.1)], 0.02)
    assert back.goal[1] == pytest.approx(session.require_arm().chain.upper[1] - 0.1)
    assert back.findings == ()


@pytest.mark.parametrize("bad", [(5, 0.1), (-1, 0.1), (0, math.nan), (True, 0.1)])
def test_invalid_nudge_is_refused(session: Session, bad: tuple[int, float]) -> None:
    with pytest.raises(InputError):
        session.check(cmd.Nudge(*bad))


def test_program_nudges_a_joint_of_a_real_server(program: Client) -> None:
    start = program.query(answers.State)
    there = program.nudge(1, 0.1)
    assert there.why == ""
    assert there.q[0] == pytest.approx(start.goal[0] + 0.1)
    assert there.q[1:] == pytest.approx(start.goal[1:])
    there = program.nudge(1, 10.0)
    assert "limit" in there.why
    assert there.q[0] == pytest.approx(program.query(answers.Arm).upper[0])
    answer = program.ask(requests.Nudge(axis=1, by=1.0))
    assert isinstance(answer, answers.Done)
    assert answer.outcome == "limited"
    assert [found.reason for found in answer.findings] == ["axis limit"]
    with pytest.raises(RefusedError, match="no axis 9"):
        program.nudge(9, 0.1)


def test_script_step_nudges(session: Session) -> None:
    plan_context = PlanContext(session, np.eye(4))
    state = session.begin(session.ready, 0.0, 0.0)
    script = "steps:\n  - nudge: {axis: 1, by: 20}\n  - nudge: {axis: 1, by: -5}\n"
    tasks = compiled(parse(script), plan_context, state).tasks
    plans = [task.action.plan for task in tasks if isinstance(task.action, FollowPlan)]
    assert len(plans) == 2
    end = session.ready + np.deg2rad((15.0, 0.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(plans[-1].end, end, rtol=0, atol=1e-12)
    with pytest.raises(ScriptError, match="line 2"):
        compiled(parse("steps:\n  - nudge: {axis: 2, by: 300}\n"), plan_context, state)
    with pytest.raises(ScriptError, match="axis"):
        parse("steps:\n  - nudge: {by: 3}\n")
