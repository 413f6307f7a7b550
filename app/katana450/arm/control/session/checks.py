"""Checks of commands against the robot, before they are executed."""

from __future__ import annotations

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.joints import JointSet
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.pouring import BASIN, CUP, MAX_VESSELS, Pouring, is_vessel
from katana450.arm.control.objects.support import check_carried, is_loose
from katana450.arm.control.session.tool_targets import branch_named
from katana450.arm.control.state.scene_objects import Attachment, SceneObject
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray

NUMBERS = {
    5: "A jog or step of this arm has 5 numbers: x, y, z, pitch and roll.",
    6: "A jog or step of this arm has 6 numbers: x, y, z, and a rotation about each axis.",
}
"""Refusals of a jog or a step with the wrong number of numbers, by the freedoms of the tool."""

ELBOW_RATES = 7
"""Number of rates of a jog that also moves the elbow."""

NO_ARM_ANGLE = (
    "The elbow of this arm cannot move while its tool rests: that takes seven turning axes. Choose "
    "another posture by its branch."
)

TURNS = {
    5: "A five-axis arm turns its tool by a pitch and a roll, not by a rotation.",
    6: "Only a five-axis arm has a pitch and a roll: give this tool a pose or a rotation.",
}
"""Refusals of a command that turns the tool of other arms."""

FARTHEST_TARGET = 1e6
"""[m] Maximum size of a coordinate in a target of the tool. A larger one is a mistake, and its
square can overflow in a search."""

NO_HAND = "Nothing can be fixed to a hand: there is no arm, or no collision checking."


def check_joints(joints: JointSet, environment: Environment, command: cmd.Command) -> None:
    """Raise InputError if a robot with ``joints`` and no arm does not support ``command``."""
    match command:
        case cmd.Batch(commands=commands):
            for part in commands:
                check_joints(joints, environment, part)
        case _ if not command.traits.joints_only:
            raise InputError(joints.refusal)
        case cmd.AxisCommand():
            command.targets(np.zeros(joints.n))
        case cmd.Servo(gripper=float()):
            raise InputError("This robot has no gripper. Leave `gripper` out.")
        case cmd.Joints(q=q) | cmd.Servo(q=q):
            joints.check(q)
        case _:
            _check_objects(None, environment, command)


def check(
    arm: ArmModel, pouring: Pouring | None, environment: Environment, command: cmd.Command
) -> None:
    """Raise InputError if ``arm`` and its environment do not support ``command``."""
    n = arm.chain.n
    match command:
        case cmd.AxisCommand():
            command.targets(np.zeros(n))
        case cmd.Batch(commands=commands):
            for part in commands:
                check(arm, pouring, environment, part)
        case cmd.Joints(q=q) | cmd.Servo(q=q) if q.shape != (n,):
            raise InputError(f"This arm has {n} joints, but the command has {q.size}.")
        case cmd.Tool(name=name):
            arm.chain_to(name)
        case cmd.Follow(plan=plan) | cmd.OfferDetour(plan=plan):
            chains = [segment.path.chain for segment in plan.segments]
            if any(not np.array_equal(chain.S, arm.chain.S) for chain in chains):
                raise InputError("The plan was made for another arm: plan it for this one.")
        case _:
            _check_tool(arm, command)
            _check_objects(pouring, environment, command)


def _check_tool(arm: ArmModel, command: cmd.Command) -> None:
    kinematics = arm.kinematics
    match command:
        case cmd.Position() | cmd.Pose() | cmd.Orient() if command.frame is cmd.Frame.BASE:
            raise InputError("The session takes targets in {S}: call `in_shoulder` first.")
        case cmd.Position(p=position):
            _check_size("The position", position)
        case cmd.Pose(T=T):
            _check_size("The position of the pose", T[:3, 3])
        case cmd.Jog(rates=numbers) | cmd.StepTool(by=numbers):
            elbow = numbers.size == ELBOW_RATES and kinematics.turns_elbow
            if numbers.size != kinematics.freedoms and not elbow:
                raise InputError(f"{NUMBERS[kinematics.freedoms]} The command has {numbers.size}.")
        case cmd.TurnElbow() if not kinematics.turns_elbow:
            raise InputError(NO_ARM_ANGLE)
        case cmd.Turn() | cmd.Orient() if not isinstance(command, kinematics.turn):
            raise InputError(TURNS[kinematics.freedoms])
        case cmd.SetPriority(priority=priority) if priority not in kinematics.priorities:
            known = ", ".join(repr(choice.value) for choice in kinematics.priorities)
            raise InputError(
                f"This arm has no priority {priority.value!r}; its priorities are {known}."
            )
        case cmd.Branch(full_name=name):
            branch_named(arm, name)


def _check_size(what: str, numbers: FloatArray) -> None:
    largest = float(np.abs(numbers).max())
    if largest > FARTHEST_TARGET:
        raise InputError(
            f"{what} has the number {largest:.2g}; give numbers up to {FARTHEST_TARGET:.0e}."
        )


def _check_objects(pouring: Pouring | None, environment: Environment, command: cmd.Command) -> None:
    match command:
        case cmd.Fill(volume=volume):
            _check_water(pouring, volume)
        case cmd.ReplaceScene(objects=objects, volume=volume):
            for scene_object in objects:
                _check_object(environment, scene_object)
                if is_loose(scene_object):
                    check_carried(environment.table, objects, scene_object)
            if sum(map(is_vessel, objects)) > MAX_VESSELS:
                raise InputError(f"A scene must have at most {MAX_VESSELS} vessels with the cup.")
            if volume is not None:
                has_cup = any(scene_object.name == CUP for scene_object in objects)
                _check_water(pouring if has_cup else None, volume)
        case cmd.PlaceObject(scene_object=scene_object):
            _check_object(environment, scene_object)
        case cmd.Attach(to=Attachment.HAND) if environment.hand is None:
            raise InputError(NO_HAND)


def _check_water(pouring: Pouring | None, volume: float) -> None:
    if pouring is None:
        raise InputError("There is no cup to fill.")
    pouring.check(volume)


def _check_object(environment: Environment, scene_object: SceneObject) -> None:
    if scene_object.fixed and environment.hand is None:
        raise InputError(NO_HAND)
    if scene_object.is_zone and scene_object.name in (CUP, BASIN):
        raise InputError(f"The {scene_object.name} cannot be a zone.")
    if scene_object.name == BASIN and is_vessel(scene_object):
        raise InputError("The basin has a form of its own: give the vessel another name.")
