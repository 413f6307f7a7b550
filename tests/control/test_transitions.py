"""The table of commands and modes is complete, and the session behaves as it states."""

from __future__ import annotations

import typing
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import classes_of
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.transitions import TABLE, Effect, effect_of, row_of
from katana450.arm.control.state.modes import (
    MODES,
    Following,
    Idle,
    Jogging,
    Leaving,
    Mode,
    Positioning,
    Servoing,
    Tracking,
)
from katana450.arm.control.state.scene_objects import Attachment, named
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from tests.control.test_commands import examples
from tests.ticks import ticked

COMMANDS = classes_of(cmd.Command)

FAR = np.array([-0.2, 0.35, 0.1])
"""[m] A target farther than a drag moves in one tick."""


def followed(session: Session, state: State) -> State:
    """Return ``state`` in the middle of a plan."""
    goal = np.array(state.setpoint)
    goal[0] += 0.8
    plan = plan_to(session.require_arm(), session.world_at(state), state, goal)
    return ticked(session, ticked(session, state, cmd.Follow(plan)), ticks=60)


OF_FIVE_AXES = [kind for kind in COMMANDS if kind not in (cmd.Orient, cmd.TurnElbow)]
"""Commands of this arm; tests/general_arms has the others."""


def example(session: Session, state: State, kind: type[cmd.Command]) -> cmd.Command:
    """Return a command of class ``kind`` that ``session`` supports."""
    objects = state.objects
    cup = named(objects, "cup")
    assert cup is not None
    pose = forward(session.require_arm().chain_to(state.tool), session.ready)
    makers: dict[type[cmd.Command], Callable[[], cmd.Command]] = {
        cmd.Joint: lambda: cmd.Joint(1, 0.5),
        cmd.Joints: lambda: cmd.Joints(session.ready + 0.1),
        cmd.Servo: lambda: cmd.Servo(np.array(state.setpoint) + 0.002),
        cmd.Position: lambda: cmd.Position(FAR + 0.01),
        cmd.Turn: lambda: cmd.Turn(-0.4, 0.3),
        cmd.StepTool: lambda: cmd.StepTool(np.array([-0.1, 0.1, -0.1, 1.0, 0.0])),
        cmd.Pose: lambda: cmd.Pose(pose),
        cmd.Gripper: lambda: cmd.Gripper(0.4),
        cmd.SetPriority: lambda: cmd.SetPriority(Priority.POSITION),
        cmd.Branch: lambda: cmd.Branch(name=str(BRANCHES[-1])),
        cmd.Follow: lambda: cmd.Follow(
            plan_to(session.require_arm(), None, state, session.ready + 0.3)
        ),
        cmd.PlaceObject: lambda: cmd.PlaceObject(cup),
        cmd.Remove: lambda: cmd.Remove("cup"),
        cmd.Attach: lambda: cmd.Attach("cup", Attachment.WORLD),
        cmd.ReplaceScene: lambda: cmd.ReplaceScene(objects),
        cmd.MoveObject: lambda: cmd.MoveObject("cup", np.array([0.3, 0.35, 0.0])),
        cmd.Batch: lambda: cmd.Batch((cmd.Speed(0.5),)),
        cmd.Jog: lambda: cmd.Jog(np.array([0.0, 0.05, 0.0, 0.0, 0.0])),
    }
    if kind in makers:
        return makers[kind]()
    return next(command for command in examples(session, state) if type(command) is kind)


def streamed(session: Session, state: State) -> State:
    """Return ``state`` in a stream that turns axis 1."""
    for number in range(10):
        q: FloatArray = session.ready + np.array([0.003 * number, 0.0, 0.0, 0.0, 0.0])
        state = ticked(session, state, cmd.Servo(q))
    return state


def left(session: Session, state: State) -> State:
    """Return ``state`` that brakes along a plan, and will jog from there."""
    state = followed(session, state)
    assert isinstance(state.mode, Following)
    jogged = ticked(session, state, example(session, state, cmd.Jog))
    assert isinstance(jogged.intent, Jogging)
    return replace(jogged, mode=Leaving(state.mode, jogged.intent))


BEGINNINGS: dict[type[Mode], Callable[[Session, State], State]] = {
    Idle: lambda _, state: state,
    Positioning: lambda session, state: ticked(
        session, state, example(session, state, cmd.Pose), cmd.Joint(1, 0.9), ticks=5, every=True
    ),
    Tracking: lambda session, state: ticked(session, state, cmd.Position(FAR)),
    Jogging: lambda session, state: ticked(
        session, state, example(session, state, cmd.Jog), ticks=5, every=True
    ),
    Servoing: streamed,
    Following: followed,
    Leaving: left,
}


def test_table_covers_every_command_and_mode() -> None:
    for kind in COMMANDS:
        assert row_of(kind) in TABLE.values()
    assert all(any(issubclass(kind, row) for kind in COMMANDS) for row in TABLE)
    assert set(BEGINNINGS) == set(typing.get_args(Mode)) == {*MODES, Leaving}
    for kind, row in TABLE.items():
        assert set(row.effects) == set(MODES)
        supersedes = Effect.SUPERSEDES in row.effects.values()
        assert supersedes == (row.begins is not None or kind is cmd.RestoreState)


def trace(state: State) -> tuple[object, ...]:
    """Return all visible parts of ``state``."""
    motion = (state.setpoint, state.motion.qd, state.motion.qdd, state.goal)
    content = tuple(values.tobytes() for values in motion)
    numbers = (state.gripper_goal, state.gripper_setpoint, state.speed, state.paused)
    return (*content, *numbers, state.findings, state.stopped, state.tool, state.priority)


@pytest.fixture(scope="module")
def beginnings(shipped: Session) -> dict[type[Mode], State]:
    """A state in each mode."""
    state = shipped.begin(shipped.ready, 0.0, 0.0)
    return {mode: begin(shipped, state) for mode, begin in BEGINNINGS.items()}


@pytest.mark.parametrize("mode", BEGINNINGS)
@pytest.mark.parametrize("kind", OF_FIVE_AXES)
def test_each_command_has_its_effect_in_each_mode(
    shipped: Session, beginnings: dict[type[Mode], State], mode: type[Mode], kind: type[cmd.Command]
) -> None:
    before = beginnings[mode]
    assert isinstance(before.mode, mode)
    command = example(shipped, before, kind)
    row, effect = row_of(kind), effect_of(command, before)
    after = ticked(shipped, before, command)
    if kind is cmd.Follow and not before.motion.at_rest:
        reasons = [finding.reason for finding in after.findings]
        # A jog reports its own findings in every tick.
        assert Reason.NOT_AT_START in reasons or after.jogging is not None
        effect = Effect.ACCEPTED
    match effect:
        case Effect.ACCEPTED:
            assert type(after.intent) is type(before.intent)
        case Effect.CONTINUES:
            assert type(after.intent) in {type(before.intent), row.begins, Positioning}
        case Effect.SUPERSEDES:
            restored = isinstance(command, cmd.RestoreState)
            assert type(after.intent) is (type(before.intent) if restored else row.begins)
        case Effect.REFUSED:
            assert trace(after) == trace(ticked(shipped, before))
            assert type(after.intent) is type(before.intent)


@pytest.mark.parametrize("kind", OF_FIVE_AXES)
def test_stop_refuses_all_commands_but_the_listed(
    shipped: Session, beginnings: dict[type[Mode], State], kind: type[cmd.Command]
) -> None:
    stopped = ticked(shipped, beginnings[Jogging], cmd.Stop())
    assert stopped.stopped is not None
    command = example(shipped, beginnings[Jogging], kind)
    if kind is cmd.ClearStop:
        stopped = ticked(shipped, stopped, ticks=120)
    after = ticked(shipped, stopped, command, cmd.Batch((cmd.Speed(0.9),)))
    assert isinstance(after.mode, Idle)
    # Only ClearStop ends a stop.
    assert (after.stopped is None) == (kind is cmd.ClearStop)
    if not kind.traits.while_stopped:
        assert effect_of(command, stopped) is Effect.REFUSED
        idle = ticked(shipped, stopped, cmd.Speed(0.9))
        assert trace(after) == trace(idle)


def test_jog_is_refused_during_a_pause(shipped: Session) -> None:
    state = shipped.begin(shipped.ready, 0.0, 0.0)
    paused = ticked(shipped, state, cmd.Pause())
    command = example(shipped, state, cmd.Jog)
    assert effect_of(command, paused) is Effect.REFUSED
    after = ticked(shipped, paused, command, ticks=20, every=True)
    assert after.findings == (Finding(Reason.PAUSED),)
    assert isinstance(ticked(shipped, after, cmd.Resume(), ticks=20, every=True).mode, Idle)
    np.testing.assert_array_equal(after.setpoint, state.setpoint)


def test_batch_has_the_effects_of_its_commands(
    shipped: Session, beginnings: dict[type[Mode], State]
) -> None:
    after = ticked(shipped, beginnings[Jogging], cmd.Batch((cmd.Speed(0.3), cmd.Home())))
    assert after.speed == 0.3
    assert isinstance(after.mode, Positioning)
