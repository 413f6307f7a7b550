"""The arm in a URDF with its place in the robot: an exact chain, with base, tools and fingers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.arm import NO_GRIPPER, ArmModel, GripperModel
from katana450.arm.control.tool_kinematics import FiveAxisTool, ToolKinematics
from katana450.arm.robot.link import Joint
from katana450.arm.robot.structure import SLIDING, Structure, structure_of
from katana450.arm.robot.urdf import Urdf, driver_of
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry import screws, se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import exact_member
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import FiveAxisKinematics


@dataclass(frozen=True, eq=False, kw_only=True)
class MountedArm(ArmModel):
    """An arm as part of a robot.

    The control core uses it as an ``ArmModel``. ``ArmModel`` is a separate class because the core
    knows neither base frames nor links.

    Attributes:
        T_base_shoulder: (4, 4) frame {S} in the root link, which stands on the table [m].
        fingers: (factor, offset) of the finger joints, the driven one first:
            value = factor * driven + offset [rad or m].
        resting: value [rad or m] of every movable joint that the arm does not drive.
        notes: sentences for a person on assumptions about the file.
    """

    T_base_shoulder: FloatArray
    fingers: Mapping[str, tuple[float, float]]
    resting: Mapping[str, float]
    notes: tuple[str, ...] = ()

    def moves(self, joint: str) -> bool:
        """Return whether the joint of that name is an axis or a finger."""
        return joint in self.chain.names or joint in self.fingers

    def ready(self, posture: Sequence[float]) -> FloatArray:
        """Return the joint angles (n,) [rad] inside limits in which the arm starts.

        ``posture``: (5,) [rad] of the canonical arm, for an arm of the five-axis family; for the
        Katana these are its joint angles.
        """
        return self.kinematics.ready(posture, self.T_base_shoulder)

    def joint_values(self, q: FloatArray, gripper: float) -> dict[str, float]:
        """Return the value of every movable joint of the robot [rad or m].

        Args:
            q: (n,) angles of the axes [rad].
            gripper: value of the driven finger joint [rad or m].
        """
        values = dict(zip(self.chain.names, (float(angle) for angle in q), strict=True))
        for joint, (factor, offset) in self.fingers.items():
            values[joint] = factor * gripper + offset
        return {**values, **self.resting}


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
    hand: Sequence[Joint], others: Sequence[Joint], frames: Mapping[str, FloatArray]
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
        speed = min(j.speed / abs(follow[j.name][0]) for j in drivable)
        lower, upper = _range(lead)
        gripper = GripperModel(lower, upper, speed, slides=lead.slides)
    by_name = {joint.name: joint for joint in (*hand, *others)}
    notes = []
    for joint in hand:
        leader = driver_of(joint, by_name)
        if joint.mimic is not None and leader is not None and leader.joint in follow:
            factor, offset = follow[leader.joint]
            follow[joint.name] = (
                leader.multiplier * factor,
                leader.multiplier * offset + leader.offset,
            )
    resting = {}
    for joint in by_name.values():
        if joint.name not in follow:
            value = _at_rest(joint)
            resting[joint.name] = value
            place = "zero" if value == 0.0 else f"{value:g} {'m' if joint.slides else 'rad'}"
            notes.append(f"Joint {joint.name!r} is {joint.type} and stays at {place}.")
    return Fingers(gripper, follow, tuple(j.name for j in drivable), resting, tuple(notes))


def _range(joint: Joint) -> tuple[float, ...]:
    """Return both limits [rad or m] of a joint with a range between them, else an empty tuple."""
    if joint.type not in ("revolute", SLIDING) or joint.limit is None:
        return ()
    # In URDF a limit that is not stated is 0.
    lower, upper = float(joint.limit.lower or 0.0), float(joint.limit.upper or 0.0)
    return (lower, upper) if -math.inf < lower < upper < math.inf else ()


def _at_rest(joint: Joint) -> float:
    """Return zero, or the limit nearest to it."""
    if joint.mimic is not None or not _range(joint):
        return 0.0
    lower, upper = _range(joint)
    return min(max(0.0, lower), upper)


def _with_lead(lead: Joint, joint: Joint, frames: Mapping[str, FloatArray]) -> tuple[float, float]:
    """Return factor and offset of a driven finger that closes when ``lead`` does."""
    low, high = _range(lead)
    lower, upper = _range(joint)
    same, mirrored = (
        math.dist((low, high), limits) for limits in ((lower, upper), (-upper, -lower))
    )
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


SHOULDER_FRAME = "shoulder_frame"
"""Name of the link whose frame is the paper's frame {S}."""


class OtherArm(NamedTuple):
    """An arm outside the five-axis family, as an extension finds it.

    Attributes:
        structure: its joints and tools.
        T_base_shoulder: (4, 4) frame {S} in the root link [m].
        chain: the chain with exact axes.
        to_tool: returns the kinematics of the same chain with another tool.
        notes: sentences for a person.
    """

    structure: Structure
    T_base_shoulder: FloatArray
    chain: Chain
    to_tool: Callable[[Chain], ToolKinematics]
    notes: tuple[str, ...]


FindArm = Callable[[Urdf, Path, str | None], OtherArm | None]
"""Returns the arm with a tool, or any, in a URDF at a path; None if there is none."""


def arm_in(
    urdf: Urdf,
    path: Path,
    tool: str | None,
    find: FindArm | None = None,
) -> MountedArm:
    """Return the arm that ``urdf`` describes.

    Args:
        urdf: the robot description.
        path: path of the file, for error messages.
        tool: link to which targets refer by default; None for the first of TOOL_FRAMES that exists,
            else the outermost link that the arm carries.
        find: finds the kinematics of an arm outside the five-axis family; None to refuse it.

    Raises:
        RobotDescriptionError: the kinematics do not support the arm. The message says what is
            wrong.
    """
    frames = urdf.frames()
    to_tool: Callable[[Chain], ToolKinematics] = FiveAxisTool
    try:
        structure = structure_of(urdf, path, tool)
        described, T_base_shoulder = described_chain(frames, structure)
        T_shoulder_base = se3.inverse(T_base_shoulder)
        up = T_shoulder_base[:3, 2]
        chain, notes = exact_member(described, up)
        notes = [*notes, *FiveAxisKinematics(chain).self_check]
        tools = {
            link: exact_member(described.with_tool(T_shoulder_base @ frames[link]), up)[0].M
            for link in structure.tools
        }
    except RobotDescriptionError:
        other = None if find is None else find(urdf, path, tool)
        if other is None:
            raise
        structure, T_base_shoulder, chain, to_tool, [*notes] = other
        T_shoulder_base = se3.inverse(T_base_shoulder)
        tools = {link: frozen(T_shoulder_base @ frames[link]) for link in structure.tools}
    fingers = fingers_of(structure.hand, structure.others, frames)
    notes = [*notes, *fingers.notes]
    if structure.chosen and fingers.driven:
        notes.append(_gripper_note(fingers, structure.tools[0]))
    return MountedArm(
        chain=chain,
        tools=tools,
        default_tool=structure.tools[0],
        to_tool=to_tool,
        gripper=fingers.gripper,
        T_base_shoulder=frozen(T_base_shoulder),
        fingers=fingers.follow,
        resting=fingers.resting,
        notes=tuple(notes),
    )


def described_chain(
    frames: Mapping[str, FloatArray], structure: Structure
) -> tuple[Chain, FloatArray]:
    """Return the chain to the default tool as the file describes it, and {S} (4, 4) in the root.

    ``frames``: pose (4, 4) of each link in the root [m]. Raises RobotDescriptionError for a joint
    without an axis or a limit.
    """
    joints = structure.axes
    T_base_shoulder = _shoulder_frame(frames, joints)
    T_shoulder_base = se3.inverse(T_base_shoulder)
    chain = Chain(
        M=T_shoulder_base @ frames[structure.tools[0]],
        S=np.column_stack([_screw(j, T_shoulder_base @ frames[j.child]) for j in joints]),
        lower=np.array([_limit(joint, "lower") for joint in joints]),
        upper=np.array([_limit(joint, "upper") for joint in joints]),
        speed=np.array([joint.speed for joint in joints]),
        names=tuple(joint.name for joint in joints),
    )
    return chain, T_base_shoulder


def _gripper_note(fingers: Fingers, tool: str) -> str:
    names = ", ".join(map(repr, fingers.driven))
    if len(fingers.driven) == 1:
        return f"Joint {names} is assumed to be a gripper joint; {tool!r} is the tool."
    return (
        f"Joints {names} are assumed to be gripper joints and driven together; "
        f"{tool!r} is the tool."
    )


def _shoulder_frame(frames: Mapping[str, FloatArray], joints: Sequence[Joint]) -> FloatArray:
    """Return {S}: the link of that name, else parallel to the root where axis 1 passes axis 2.

    A rail or a lift before these axes does not count.
    """
    if SHOULDER_FRAME in frames:
        return frames[SHOULDER_FRAME]
    turning = [joint for joint in joints if not joint.slides]
    one, two = (_screw(joint, frames[joint.child]) for joint in turning[:2])
    p1, p2 = screws.point_on(one), screws.point_on(two)
    # The foot on axis 1 of the common normal of the two lines.
    normal = np.cross(one[:3], two[:3])
    size = float(normal @ normal)
    along = float(np.cross(p2 - p1, two[:3]) @ normal) / size if size > 0.0 else 0.0
    return se3.from_rotation_translation(np.eye(3), p1 + along * one[:3])


def _screw(joint: Joint, T_shoulder_child: FloatArray) -> FloatArray:
    """Return the joint's screw axis (6,) in {S}; the axis passes through its child's origin."""
    direction = T_shoulder_child[:3, :3] @ joint.axis
    try:
        if joint.slides:
            return screws.prismatic(direction)
        return screws.revolute(direction, T_shoulder_child[:3, 3])
    except InputError as error:
        raise RobotDescriptionError(
            f"The description of joint {joint.name!r} is wrong. {error}"
        ) from error


def _limit(joint: Joint, which: str) -> float:
    if joint.type == "continuous" and which in ("lower", "upper"):
        return math.pi if which == "upper" else -math.pi
    value = None if joint.limit is None else getattr(joint.limit, which)
    if value is None:
        raise RobotDescriptionError(
            f"Joint {joint.name!r} has no {which} limit. Add {which!r} to its <limit>."
        )
    return float(value)
