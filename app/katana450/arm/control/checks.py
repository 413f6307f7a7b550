"""Checks of commands against the robot, before they are taken: what it cannot even be asked."""

from __future__ import annotations

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.arm import Arm
from katana450.arm.control.joints import Joints
from katana450.arm.control.pouring import CUP, Pouring
from katana450.arm.control.support import check_carried, is_loose
from katana450.arm.control.things import Environment, Mount, Thing
from katana450.errors import InputError

NO_HAND = "This arm's contacts are not looked at, so nothing can be fixed to its hand."


def check_joints(joints: Joints, command: cmd.Command) -> None:
    """Raise InputError if a robot with ``joints`` and no arm cannot be asked for ``command``."""
    match command:
        case cmd.Batch(commands=commands):
            for each in commands:
                check_joints(joints, each)
        case _ if not command.traits.joints_only:
            raise InputError(joints.refusal)
        case cmd.AxisCommand():
            command.targets(np.zeros(joints.n))
        case cmd.SetJoints(q=q) | cmd.Servo(q=q):
            joints.check(q)


def check(
    arm: Arm, pouring: Pouring | None, surroundings: Environment, command: cmd.Command
) -> None:
    """Refuse, with an InputError for the sender, what this arm cannot even be asked."""
    n = arm.chain.n
    match command:
        case cmd.AxisCommand():
            command.targets(np.zeros(n))
        case cmd.Batch(commands=commands):
            for each in commands:
                check(arm, pouring, surroundings, each)
        case cmd.SetJoints(q=q) | cmd.Servo(q=q) if q.shape != (n,):
            raise InputError(f"This arm has {n} joints, the command {q.size}.")
        case cmd.SetTool(name=name):
            arm.chain_to(name)
        case cmd.Follow(plan=plan):
            chains = [segment.path.chain for segment in plan.segments]
            if any(not np.array_equal(chain.S, arm.chain.S) for chain in chains):
                raise InputError("The plan was made for another arm.")
        case _:
            _check_things(pouring, surroundings, command)


def _check_things(pouring: Pouring | None, surroundings: Environment, command: cmd.Command) -> None:
    match command:
        case cmd.Fill(volume=volume):
            _check_water(pouring, volume)
        case cmd.Furnish(things=things, volume=volume):
            for thing in things:
                _check_hand(surroundings, thing)
                if is_loose(thing):
                    check_carried(surroundings.table, things, thing)
            if volume is not None:
                has_cup = any(thing.name == CUP for thing in things)
                _check_water(pouring if has_cup else None, volume)
        case cmd.Place(thing=thing):
            _check_hand(surroundings, thing)
        case cmd.Attach(to=Mount.HAND) if surroundings.hand is None:
            raise InputError(NO_HAND)


def _check_water(pouring: Pouring | None, volume: float) -> None:
    if pouring is None:
        raise InputError("There is no cup to fill.")
    pouring.check(volume)


def _check_hand(surroundings: Environment, thing: Thing) -> None:
    if thing.fixed and surroundings.hand is None:
        raise InputError(NO_HAND)
