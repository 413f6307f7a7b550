"""Commands are checked when they are made."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.errors import InputError

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
        (lambda: cmd.Branch("front"), "or a name"),
        (cmd.Branch, "or a name"),
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
