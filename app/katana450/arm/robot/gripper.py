"""The fingers behind the last axis of an arm, all driven by one number."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.gripper_model import NO_GRIPPER, GripperModel
from katana450.arm.robot.link import SLOW_SLIDE, SLOW_TURN
from katana450.arm.robot.urdf import UrdfJoint
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray

SLIDING = "prismatic"

PERPENDICULAR = 0.5
"""Cosine between two axes up to which they point neither in the same nor in opposite directions."""


@dataclass(frozen=True)
class Fingers:
    """The joints of a gripper.

    Attributes:
        gripper: limits and speed of the number that drives them: the value of the first joint.
        follow: (factor, offset) of each finger joint: its value is factor * driven + offset
            [rad or m]. The first is the driven one itself.
        driven: the finger joints that mimic no other.
        resting: the value [rad or m] of each joint that does not move.
        notes: sentences for a person on the joints that do not move.
    """

    gripper: GripperModel
    follow: Mapping[str, tuple[float, float]]
    driven: tuple[str, ...]
    resting: Mapping[str, float]
    notes: tuple[str, ...]


def fingers_of(
    hand: Sequence[UrdfJoint], others: Sequence[UrdfJoint], frames: Mapping[str, FloatArray]
) -> Fingers:
    """Return the gripper made of the movable joints ``hand``.

    Joints of ``hand`` that cannot be fingers rest, and so do ``others``. Driven fingers without
    `mimic` move together, each from one of its limits to the other.

    Args:
        hand: movable joints behind the last axis.
        others: all other movable joints.
        frames: (4, 4) of every link in the root at zero.
    """
    drivable = [j for j in hand if j.mimic is None and _range(j)]
    # The joint that opens towards positive numbers drives the others.
    drivable.sort(key=lambda joint: -sum(_range(joint)))
    follow: dict[str, tuple[float, float]] = {}
    gripper = NO_GRIPPER
    if drivable:
        lead, *rest = drivable
        follow = {lead.name: (1.0, 0.0)} | {j.name: _with_lead(lead, j, frames) for j in rest}
        speed = min(_speed(j) / abs(follow[j.name][0]) for j in drivable)
        lower, upper = _range(lead)
        gripper = GripperModel(lower, upper, speed, slides=lead.type == SLIDING)
    by_name = {joint.name: joint for joint in (*hand, *others)}
    notes = []
    for joint in hand:
        found = _following(joint, by_name, follow) if joint.mimic is not None else None
        if found is not None:
            follow[joint.name] = found
    resting = {}
    for joint in by_name.values():
        if joint.name not in follow:
            value = _at_rest(joint)
            resting[joint.name] = value
            place = "zero" if value == 0.0 else f"{value:g} {_unit(joint)}"
            notes.append(f"Joint {joint.name!r} is {joint.type} and stays at {place}.")
    return Fingers(gripper, follow, tuple(j.name for j in drivable), resting, tuple(notes))


def _range(joint: UrdfJoint) -> tuple[float, ...]:
    """Return both limits [rad or m] of a joint with a range between them, else an empty tuple."""
    if joint.type not in ("revolute", SLIDING) or joint.limit is None:
        return ()
    # In URDF a limit that is not stated is 0.
    lower, upper = float(joint.limit.lower or 0.0), float(joint.limit.upper or 0.0)
    return (lower, upper) if -math.inf < lower < upper < math.inf else ()


def _speed(joint: UrdfJoint) -> float:
    """Return the speed of ``joint`` [rad/s or m/s]."""
    speed = None if joint.limit is None else joint.limit.velocity
    if speed is None or not 0.0 < speed < math.inf:
        return SLOW_SLIDE if joint.type == SLIDING else SLOW_TURN
    return float(speed)


def _unit(joint: UrdfJoint) -> str:
    return "m" if joint.type == SLIDING else "rad"


def _at_rest(joint: UrdfJoint) -> float:
    """Return zero, or the limit nearest to it."""
    if joint.mimic is not None or not _range(joint):
        return 0.0
    lower, upper = _range(joint)
    return min(max(0.0, lower), upper)


def _with_lead(
    lead: UrdfJoint, joint: UrdfJoint, frames: Mapping[str, FloatArray]
) -> tuple[float, float]:
    """Return factor and offset of a driven finger that closes when ``lead`` does."""
    low, high = _range(lead)
    lower, upper = _range(joint)
    same, mirrored = (math.dist((low, high), each) for each in ((lower, upper), (-upper, -lower)))
    if same == mirrored:
        # Fingers that close on each other move in opposite directions.
        one, other = (frames[j.child][:3, :3] @ np.asarray(j.axis) for j in (lead, joint))
        turned = bool(one @ other > PERPENDICULAR * np.linalg.norm(one) * np.linalg.norm(other))
    else:
        turned = mirrored < same
    if turned:
        lower, upper = upper, lower
    factor = (upper - lower) / (high - low)
    return factor, lower - factor * low


def _following(
    joint: UrdfJoint, joints: Mapping[str, UrdfJoint], follow: Mapping[str, tuple[float, float]]
) -> tuple[float, float] | None:
    """Return factor and offset of a joint that mimics another; None if it follows no finger.

    Raises RobotDescriptionError if it mimics itself, directly or through others.
    """
    factor, offset = 1.0, 0.0
    passed = [joint.name]
    while joint.mimic is not None:
        offset += factor * float(joint.mimic.offset or 0.0)
        factor *= 1.0 if joint.mimic.multiplier is None else float(joint.mimic.multiplier)
        above = joints.get(joint.mimic.joint)
        if above is None:
            return None
        if above.name in passed:
            raise RobotDescriptionError(
                f"Joint {passed[0]!r} mimics {joint.mimic.joint!r}, which is not driven and "
                "follows no driven joint. Name a driven joint in its <mimic>."
            )
        passed.append(above.name)
        joint = above
    if joint.name not in follow:
        return None
    a, b = follow[joint.name]
    return factor * a, factor * b + offset
