"""What an arm cannot even be asked."""

from __future__ import annotations

import numpy as np

from app.control import commands as cmd
from app.control.arm import Arm
from app.control.pouring import Pouring
from app.errors import InputError


def check(arm: Arm, pouring: Pouring | None, command: cmd.Command) -> None:
    """Refuse, with an InputError for the sender, what this arm cannot even be asked."""
    n = arm.chain.n
    match command:
        case cmd.SetJoint(axis=axis) if axis >= n:
            raise InputError(f"There is no axis {axis + 1}: this arm has {n}.")
        case cmd.SetAxes(values=values):
            for axis, value in values:
                check(arm, pouring, cmd.SetJoint(axis, value))
        case cmd.Together(commands=commands):
            for each in commands:
                check(arm, pouring, each)
        case cmd.SetJoints(q=q) | cmd.Servo(q=q) if q.shape != (n,):
            raise InputError(f"This arm has {n} joints, the command {q.size}.")
        case cmd.SetTool(name=name):
            arm.chain_to(name)
        case cmd.Fill(volume=volume):
            if pouring is None:
                raise InputError("There is no cup to fill.")
            pouring.check(volume)
        case cmd.Follow(plan=plan):
            chains = [segment.path.chain for segment in plan.segments]
            if any(not np.array_equal(chain.S, arm.chain.S) for chain in chains):
                raise InputError("The plan was made for another arm.")
