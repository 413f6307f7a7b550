"""Commands are checked when they are made."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, get_type_hints

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import Command, Traits, classes_of
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.arm_report import ArmAct
from katana450.arm.control.state.scene_objects import Attachment, SceneObject, Shape
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.arm.runtime.mailbox import Mailbox
from katana450.errors import InputError
from katana450.maths.kinematics.priority import Priority

NAN = math.nan


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: cmd.Joint(1, NAN), "axis 1 must be a finite number"),
        (lambda: cmd.Joint(3, math.inf), "axis 3"),
        (lambda: cmd.Joint(0, 0.0), "whole number from 1"),
        (lambda: cmd.Joint(True, 0.0), "whole number from 1"),
        (lambda: cmd.Joint(1, "1"), "finite number"),  # type: ignore[arg-type]
        (lambda: cmd.Joints(np.array([0.0, NAN])), "finite"),
        (lambda: cmd.Joints(np.zeros((2, 2))), "flat list"),
        (lambda: cmd.Joints(np.array([])), "flat list"),
        (lambda: cmd.Joints([[1.0], [2.0, 3.0]]), "list of numbers"),  # type: ignore[arg-type]
        (lambda: cmd.Position(np.zeros(2)), "3 numbers"),
        (lambda: cmd.Position(np.array([0.0, 0.0, NAN])), "finite"),
        (lambda: cmd.Position("abc"), "list of numbers"),  # type: ignore[arg-type]
        (lambda: cmd.Turn(NAN, 0.0), "pitch"),
        (lambda: cmd.StepTool(np.zeros(3)), "5 or 6 numbers"),
        (lambda: cmd.StepTool(np.zeros(5), "tool"), "JogFrame"),  # type: ignore[arg-type]
        (lambda: cmd.Turn(0.0, -math.inf), "roll"),
        (lambda: cmd.Pose(np.zeros((4, 4))), "T"),
        (lambda: cmd.Pose(np.diag([1.0, 1.0, 2.0, 1.0])), "rotation"),
        (lambda: cmd.Pose(np.full((4, 4), NAN)), "finite"),
        (lambda: cmd.Pose(np.eye(3)), "shape"),
        (lambda: cmd.Gripper(NAN), "finger"),
        (lambda: cmd.SetPriority("pose"), "Priority.POSE"),  # type: ignore[arg-type]
        (lambda: cmd.SetPriority([]), "Priority.POSE"),  # type: ignore[arg-type]
        (lambda: cmd.Orient(np.ones((3, 3))), "rotation"),
        (lambda: cmd.Jog([0.1] * 4), "jog"),  # type: ignore[arg-type]
        (lambda: cmd.Jog([NAN] * 5), "jog"),  # type: ignore[arg-type]
        (lambda: cmd.Jog("fast"), "jog"),  # type: ignore[arg-type]
        (lambda: cmd.Jog([[0.1] * 5]), "jog"),  # type: ignore[arg-type]
        (lambda: cmd.Jog(np.zeros(5), "world"), "JogFrame"),  # type: ignore[arg-type]
        *(
            (lambda fraction=fraction: cmd.Speed(fraction), "speed")
            for fraction in (0.0, -0.1, 1.1, NAN, math.inf, True, "1")
        ),
    ],
)
def test_invalid_command_is_refused_with_the_reason(
    make: Callable[[], object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_command_copies_its_array() -> None:
    q = np.zeros(5)
    command = cmd.Joints(q)
    q[0] = 1.0
    assert command.q[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        command.q[0] = 1.0


@pytest.mark.parametrize(
    "target", [cmd.Position(np.array((0.3, 0.1, 0.2))), cmd.Pose(np.eye(4)), cmd.Orient(np.eye(3))]
)
def test_session_refuses_a_target_in_the_base_frame(
    session: Session, target: cmd.Position | cmd.Pose | cmd.Orient
) -> None:
    with pytest.raises(InputError, match="in_shoulder"):
        session.check(replace(target, frame=cmd.Frame.BASE))


KINDS = classes_of(Command)

BALL = SceneObject("ball", Shape.SPHERE, (0.02,), np.eye(4))


PLAIN: dict[object, object] = {int: 1, float: 0.1, str: "ball", Finding: Finding(Reason.PAUSED)}
"""Values of fields by their types, for commands whose fields may have any value."""


@cache
def examples(session: Session, state: State) -> tuple[cmd.Command, ...]:
    """Return one command of example class. Only fields with further types need an entry here."""
    arm = session.require_arm()
    q = np.zeros(arm.chain.n)
    commands: list[Command] = [
        *(cmd.SetAxes(((1, 0.1),)), cmd.Joints(q), cmd.Servo(q), cmd.Jog(np.full(5, 0.1))),
        cmd.Servo(q).timed(0.1),
        *(cmd.Position(np.array((0.3, 0.0, 0.1))), cmd.Pose(np.eye(4))),
        *(cmd.StepTool(np.full(5, 0.01)), cmd.Orient(np.eye(3)), cmd.Branch(name="front-up")),
        *(cmd.Tool("flange"), cmd.SetPriority(Priority.PITCH), cmd.Fill(100.0)),
        *(cmd.Follow(plan_to(arm, None, state, q)), cmd.PlaceObject(BALL)),
        *(cmd.Attach("ball", Attachment.WORLD), cmd.ReplaceScene((BALL,))),
        *(cmd.OperateArm(ArmAct.UNBLOCK), cmd.Batch((cmd.Home(),)), cmd.RestoreState(state)),
    ]
    kinds: dict[Any, Any] = {type(command): command for command in commands}
    return tuple(kinds.get(kind) or plain_example(kind) for kind in KINDS)


def plain_example(kind: Any) -> Any:
    """Return a command of a class whose fields are numbers and texts."""
    types = get_type_hints(kind)
    needed = [field.name for field in msgspec.structs.fields(kind) if field.required]
    assert all(types[name] in PLAIN for name in needed), f"add an example of {kind.__name__}"
    return kind(**{name: PLAIN[types[name]] for name in needed})


def test_every_command_class_is_a_command_and_declares_its_traits() -> None:
    assert len(KINDS) > 30
    for kind in KINDS:
        # Those that only the server gives derive from others.
        declared = any("traits" in vars(base) for base in (kind, *kind.__bases__))
        assert declared, f"{kind.__name__} declares no traits"
        assert getattr(cmd, kind.__name__) is kind
        assert kind.__doc__


def test_commands_passive_to_planning_supersede_nothing() -> None:
    with pytest.raises(ValueError, match="passive"):
        Traits(passive=True, supersedes=True)


def test_only_stop_is_a_safety_command() -> None:
    assert [kind for kind in KINDS if kind.traits.safety] == [cmd.Stop]


def test_no_command_of_the_server_itself_moves_the_arm(session: Session, state: State) -> None:
    protective = [command for command in examples(session, state) if command.traits.protective]
    assert {type(command) for command in protective} == {cmd.Stop, cmd.Hold, cmd.HoldFor, cmd.Speed}
    for example in protective:
        after = session.step(state, [example], state.t)
        assert not after.moving, example


def test_mailbox_keeps_only_the_newest_of_a_stream(session: Session, state: State) -> None:
    for command in examples(session, state):
        mailbox = Mailbox(lambda _: None)
        mailbox.put(command)
        mailbox.put(command)
        count = len(mailbox.drain().commands)
        assert count == (1 if command.traits.stream or command.traits.safety else 2), command
