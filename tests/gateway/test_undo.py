"""Undo over the API: goals, objects and settings, never past a stop."""

from __future__ import annotations

import time

import numpy as np
import pytest

from katana450.client import Client, RefusedError
from katana450.server.api import answers, requests
from tests.gateway.virtual import VirtualServer


def state(program: Client) -> answers.State:
    return program.query(answers.State)


def undo(program: Client) -> answers.State:
    return program.go(requests.Undo())


def names(program: Client) -> set[str]:
    return {item.name for item in program.query(answers.Objects).objects}


def test_goals_are_undone_in_order(program: Client) -> None:
    start = program.go(requests.Home())
    program.nudge(1, 0.2)
    program.go(requests.StepTool(by=np.array((0.0, 0.0, 0.03, 0.0, 0.0))))
    after_nudge = undo(program)
    np.testing.assert_allclose(after_nudge.q[0], start.q[0] + 0.2, atol=1e-6)
    np.testing.assert_allclose(np.array(after_nudge.q)[1:], start.q[1:], atol=1e-6)
    np.testing.assert_allclose(undo(program).q, start.q, atol=1e-6)


def test_undone_changes_are_redone_until_the_next_change(program: Client) -> None:
    start = program.go(requests.Home())
    nudged = program.nudge(1, 0.2)
    program.ask(requests.Remove(name="basin"))
    before = names(program)
    program.ask(requests.Undo())
    undo(program)
    np.testing.assert_allclose(state(program).q, start.q, atol=1e-6)
    np.testing.assert_allclose(program.go(requests.Redo()).q, nudged.q, atol=1e-6)
    program.ask(requests.Redo())
    assert names(program) == before
    with pytest.raises(RefusedError, match="nothing to redo"):
        program.ask(requests.Redo())
    # What was redone is undone again, and a new change ends what can be redone.
    program.ask(requests.Undo())
    assert names(program) == before | {"basin"}
    np.testing.assert_allclose(undo(program).q, start.q, atol=1e-6)
    program.nudge(2, 0.05)
    with pytest.raises(RefusedError, match="nothing to redo"):
        program.ask(requests.Redo())


def test_settings_are_undone(program: Client) -> None:
    before = state(program)
    program.ask(requests.Speed(value=0.5))
    program.go(requests.Gripper(angle=before.gripper - 0.2))
    program.ask(requests.Tool(name="flange"))
    undo(program)
    undo(program)
    undo(program)
    after = state(program)
    assert (after.tool, after.speed) == (before.tool, before.speed)
    assert after.gripper_goal == pytest.approx(before.gripper_goal)


def test_removed_object_returns_and_new_one_goes(program: Client) -> None:
    before = names(program)
    program.ask(requests.Remove(name="basin"))
    program.ask(requests.Place(name="block", shape=requests.Shape.BOX, size=[0.03, 0.03, 0.03]))
    assert names(program) == before - {"basin"} | {"block"}
    program.ask(requests.Undo())
    program.ask(requests.Undo())
    assert names(program) == before


def test_look_and_place_of_an_object_are_undone(program: Client) -> None:
    def basin() -> answers.SceneObject:
        objects = program.query(answers.Objects).objects
        return next(item for item in objects if item.name == "basin")

    before = basin()
    T = np.array(before.T)
    T[0, 3] += 0.02
    program.ask(requests.Place(name="basin", colour="#204060"))
    program.ask(requests.Place(name="basin", opacity=0.5, hidden=True))
    program.ask(requests.Place(name="basin", T=T))
    # As at the end of a drag, which sends the last place again.
    program.ask(requests.Place(name="basin", T=T))
    changed = basin()
    assert (changed.colour, changed.opacity, changed.hidden) == ("#204060", 0.5, True)
    np.testing.assert_allclose(changed.T, T, atol=1e-9)
    # All within a second count as one change.
    program.ask(requests.Undo())
    assert basin() == before


def test_nothing_is_undone_while_stopped_or_past_a_stop(program: Client) -> None:
    moved = program.nudge(1, 0.2)
    program.ask(requests.Stop())
    with pytest.raises(RefusedError, match="stopped"):
        program.ask(requests.Undo())
    program.clear_stop()
    with pytest.raises(RefusedError, match="nothing to undo"):
        program.ask(requests.Undo())
    np.testing.assert_allclose(state(program).q, moved.q, atol=1e-6)


def test_nothing_is_undone_past_a_change_of_driver(local: VirtualServer, program: Client) -> None:
    moved = program.nudge(1, 0.2)
    program.ask(requests.ReleaseLease())
    with local.connect("Other") as other:
        with pytest.raises(RefusedError, match="nothing to undo"):
            other.ask(requests.Undo())
        other.ask(requests.Acquire())
        other.ask(requests.ReleaseLease())
    program.ask(requests.Acquire())
    with pytest.raises(RefusedError, match="nothing to undo"):
        program.ask(requests.Undo())
    np.testing.assert_allclose(state(program).q, moved.q, atol=1e-6)


def test_undo_that_began_before_a_stop_is_refused(program: Client) -> None:
    before = program.nudge(1, 0.1).revocations
    program.ask(requests.Stop())
    program.clear_stop()
    moved = program.nudge(1, 0.1)
    with pytest.raises(RefusedError, match="Do it again"):
        program.ask(requests.Undo(revocations=before))
    np.testing.assert_allclose(state(program).q, moved.q, atol=1e-6)


def test_undo_does_not_leap_over_a_stream(program: Client) -> None:
    q = np.array(program.nudge(1, 0.1).q)
    for _ in range(20):
        q[0] += 0.005
        program.send(requests.Servo(q=q))
        time.sleep(0.02)
    time.sleep(1.0)
    streamed = state(program)
    with pytest.raises(RefusedError, match="nothing to undo"):
        program.ask(requests.Undo())
    np.testing.assert_allclose(state(program).q, streamed.q, atol=1e-6)
