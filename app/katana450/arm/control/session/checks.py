"""Checks of commands against the robot, their refusals in a state, and their outcomes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from katana450.arm.control.arm import ArmModel, JointSet
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.loose_objects import check_carried, is_loose
from katana450.arm.control.objects.pouring import BASIN, CUP, MAX_VESSELS, Pouring, is_vessel
from katana450.arm.control.session.goals import without_finding
from katana450.arm.control.session.stopping import clear_refusal
from katana450.arm.control.session.tool_targets import branch_named
from katana450.arm.control.session.transitions import Effect, effect_of
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.scene_objects import MAX_OBJECTS, Attachment, SceneObject, named
from katana450.arm.control.state.state import (
    ACCEPTED,
    CAUSES,
    Outcome,
    PartRefusal,
    Reason,
    State,
    Verdict,
)
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
        case cmd.RestoreState(state=state):
            arm.chain_to(state.tool)
        case cmd.Follow(plan=plan):
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
        case cmd.Branch(name=name):
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


INTENDED_REASONS = (Reason.STOPPED, Reason.PAUSED, Reason.WAITING, *CAUSES)
"""Reasons that are the purpose of a command, and limit nothing."""


def refused(why: str) -> Outcome:
    """Return the outcome of a command that takes no effect, for the reason ``why``."""
    return Outcome(Verdict.REFUSED, why=why)


DROPPED = refused("The arm was stopped before it took effect. Clear the stop, then send it again.")
"""Outcome of a command that waited when a stop came."""

FAILED = refused("An internal error stopped it: the arm holds. See the log of the server.")
"""Outcome of a command in a tick that failed."""


def take_all(
    take: Callable[[State, cmd.Command], State], state: State, command: cmd.Command
) -> tuple[State, Outcome]:
    """Return ``take(state, command)`` and its outcome; ``state`` itself if it is refused.

    The parts of a batch are taken one after another.
    """
    if not isinstance(command, cmd.Batch):
        why = refusal(state, command)
        if why:
            return state, refused(why)
        after = take(state, command)
        if isinstance(command, cmd.RestoreState):
            # Its findings are of its own time.
            return after, ACCEPTED
        command_outcome = outcome(state, after)
        if command_outcome.verdict is Verdict.REFUSED:
            # A plan that begins elsewhere. It leaves no trace but the finding that says so.
            others = without_finding(state, Reason.NOT_AT_START).findings
            after = replace(state, findings=(*others, *command_outcome.findings))
        return after, command_outcome
    outcomes = []
    for part in command.commands:
        state, part_outcome = take_all(take, state, part)
        outcomes.append(part_outcome)
    return state, _merged(command, outcomes)


def refusal(state: State, command: cmd.Command) -> str:
    """Return why ``command`` takes no effect in ``state``; an empty text if it does."""
    if effect_of(command, state) is Effect.REFUSED:
        return _why_refused(state, command)
    match command:
        case cmd.ClearStop(known=newest, t=t):
            return clear_refusal(state, max(t, state.t), newest)
        case cmd.RestoreState() if state.report is not None:
            return "A real arm cannot be set back. Move it to that posture by Run again."
        case cmd.OperateArm() if state.report is None:
            return "This arm is simulated: it has no connection, calibration or motors to operate."
        case cmd.OperateArm() if state.stopped is None or state.moving:
            return "Stop the arm first, and wait until it is at rest."
        case cmd.OperateArm(act=act) if state.report and act not in state.report.mode.acts:
            now = state.report.mode.value
            return f"{act.value.capitalize()} is not possible while the arm is {now}."
        case cmd.PlaceObject(scene_object=scene_object):
            known = named(state.objects, scene_object.name)
            if known is None and len(state.objects) >= MAX_OBJECTS:
                return f"There are {MAX_OBJECTS} objects already: remove one first."
            return _held(state, scene_object.name)
        case cmd.Remove(name=name) | cmd.MoveObject(name=name) | cmd.Attach(name=name):
            if named(state.objects, name) is None:
                return f"There is no object {name!r}."
            on_joint = not isinstance(command, cmd.Remove) and _on_joint(state, name)
            return on_joint or _held(state, name)
    return ""


def _why_refused(state: State, command: cmd.Command) -> str:
    if state.stopped is not None and not command.traits.while_stopped:
        return "The arm is stopped: clear the stop first."
    if state.paused and not command.traits.while_paused:
        return "The arm is paused: resume first."
    if isinstance(command, cmd.EndDrag):
        return "There is no drag to end: another command has ended it."
    return f"{type(command).__name__} is not possible in this mode."


def outcome(before: State, after: State) -> Outcome:
    """Return the outcome of a command that took ``before`` to ``after``."""
    findings = tuple(
        finding
        for finding in after.findings
        if finding.reason not in INTENDED_REASONS
        and not any(finding is known for known in before.findings)
    )
    if any(finding.reason is Reason.NOT_AT_START for finding in findings):
        return Outcome(Verdict.REFUSED, findings)
    return Outcome(Verdict.LIMITED, findings) if findings else ACCEPTED


def _on_joint(state: State, name: str) -> str:
    scene_object = named(state.objects, name)
    if scene_object is None or scene_object.joint is None:
        return ""
    return f"{name!r} is on a joint: it moves only by it. Change its place in the scene file."


def _held(state: State, name: str) -> str:
    scene_object = named(state.objects, name)
    if scene_object is None or not scene_object.held:
        return ""
    return f"The gripper holds {name!r}: open it first."


def reason(refusal: Outcome) -> str:
    """Return the reason of a refusal in words."""
    return refusal.why or "; ".join(finding_text(finding) for finding in refusal.findings) + "."


def _merged(batch: cmd.Batch, outcomes: list[Outcome]) -> Outcome:
    """Return the outcome of ``batch`` by those of its parts: refused if all are."""
    findings = tuple(finding for combined in outcomes for finding in combined.findings)
    refusals = tuple(
        PartRefusal(part, type(command).__name__, reason(combined))
        for part, (command, combined) in enumerate(zip(batch.commands, outcomes, strict=True))
        if combined.verdict is Verdict.REFUSED
    )
    if refusals and len(refusals) == len(outcomes):
        why = " ".join(dict.fromkeys(combined.why for combined in refusals))
        return Outcome(Verdict.REFUSED, findings, why, refusals)
    limited = refusals or findings
    return Outcome(Verdict.LIMITED, findings, refused=refusals) if limited else ACCEPTED
