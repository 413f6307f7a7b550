"""The robot: a tree of links and joints, with an arm if the kinematics support one."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from katana450.arm.control.arm import NO_GRIPPER, JointSet
from katana450.arm.control.state.messages import axis_label, axis_names
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.visual import Visual
from katana450.caching import cached_property
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.statics import LinkLoad

LIMIT_TOLERANCE = 1e-9
"""[rad, m] Excess over a limit that is accepted."""

SEARCHED_RANGE = math.pi / 2.0
"""[rad, m] Limit of a joint's range in the search for the bounds of a robot."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot as its URDF file describes it.

    Attributes:
        name: of the robot.
        links: parents first; the first is the root.
        arm: the part that brings a tool to poses; None if the robot can only be driven joint by
            joint.
        why: the reason for that as a sentence; empty if there is an arm.
        notes: sentences for a person on what is missing in its files.
        faults: sentences on joints that stay at zero because they cannot be moved.
        path: its URDF file.
        cautions: sentences for its driver on links that are not checked, or that look wrong.
    """

    name: str
    links: tuple[Link, ...]
    arm: MountedArm | None
    why: str = ""
    notes: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    path: Path | None = None
    cautions: tuple[str, ...] = ()

    def require_arm(self) -> MountedArm:
        """Return the arm. Raises RobotDescriptionError with the reason if there is none."""
        if self.arm is None:
            raise RobotDescriptionError(self.why)
        return self.arm

    def check_complete(self) -> None:
        """Raise RobotDescriptionError if there is a joint that the tree cannot move."""
        if self.faults:
            raise RobotDescriptionError(self.faults[0])

    def read_shapes(self) -> None:
        """Read the meshes of all links now. Raises RobotDescriptionError for an unreadable one."""
        for link in self.links:
            len(link.shapes)

    @cached_property
    def joints(self) -> Mapping[str, Joint]:
        """All movable joints by name."""
        return {link.joint.name: link.joint for link in self.links if link.joint is not None}

    @cached_property
    def driven(self) -> tuple[str, ...]:
        """Names of the joints that follow no other, in the order of the links."""
        return tuple(name for name, joint in self.joints.items() if joint.leader == name)

    def children(self, link: Link) -> tuple[Link, ...]:
        """Return the links whose parent is ``link``."""
        return tuple(other for other in self.links if other.parent == link.name)

    @cached_property
    def home(self) -> Mapping[str, FloatArray]:
        """Pose (4, 4) of each link in the root with every joint at zero [m]."""
        return self.frames({})

    def path_to(self, link: Link) -> tuple[Link, ...]:
        """Return the links from the root to ``link``."""
        if link.parent is None:
            return (link,)
        parent = next(other for other in self.links if other.name == link.parent)
        return (*self.path_to(parent), link)

    def axis(self, joint: Joint) -> FloatArray:
        """Return the unit direction (3,) of ``joint`` in the root's frame at zero."""
        link = next(link for link in self.links if link.joint is joint)
        return self.home[link.name][:3, :3] @ joint.axis

    def values(self, pose: Sequence[float]) -> dict[str, float]:
        """Return the value of every joint [rad] or [m] from those of the first driven joints.

        Driven joints beyond the length of `pose` stay at zero, or at the limit nearest to it.
        Raises InputError for too many values, values that are no numbers, and values beyond the
        limits.
        """
        driven = self.driven
        if len(pose) > len(driven):
            raise InputError(
                f"A pose of {self.name} has at most {len(driven)} numbers "
                f"({', '.join(driven)}), not {len(pose)}."
            )
        numbers = finite_array(pose, (len(pose),), "The pose").tolist()
        values = dict(zip(driven, numbers, strict=False))
        for name, value in values.items():
            self.check(name, value)
        return self.every(values)

    def check(self, name: str, value: float) -> None:
        """Raise InputError if `value` [rad] or [m] is outside the limits of joint `name`."""
        joint = self.joints[name]
        if not joint.lower - LIMIT_TOLERANCE <= value <= joint.upper + LIMIT_TOLERANCE:
            unit = "m" if joint.slides else "rad"
            raise InputError(
                f"{name} cannot be at {value:g} {unit}; "
                f"its range is {joint.lower:g} to {joint.upper:g} {unit}."
            )

    def every(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the value of every joint, from those of some driven joints."""
        leaders = {name: self.joints[name] for name in self.driven}
        every = {
            name: values.get(name, min(max(0.0, joint.lower), joint.upper))
            for name, joint in leaders.items()
        }
        return {
            name: joint.factor * every[joint.leader] + joint.offset
            for name, joint in self.joints.items()
        }

    def frames(self, values: Mapping[str, float]) -> dict[str, FloatArray]:
        """Return the pose (4, 4) of each link in the root [m]; joints without a value are at 0."""
        frames: dict[str, FloatArray] = {}
        for link in self.links:
            T = link.T_parent_link
            if link.parent is not None:
                T = frames[link.parent] @ T
            if link.joint is not None and link.joint.name in values:
                T = T @ link.joint.motion(values[link.joint.name])
            frames[link.name] = frozen(T)
        return frames

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,) [m] of all shapes in the root.

        Searched at zero, and with each driven joint in turn at its limits and in their middle.
        """
        poses = [self.every({})]
        for name in self.driven:
            joint = self.joints[name]
            ends = [max(joint.lower, -SEARCHED_RANGE), min(joint.upper, SEARCHED_RANGE)]
            poses += [self.every({name: value}) for value in (*ends, sum(ends) / 2.0)]
        corners = [np.zeros((1, 3))]
        for frames in map(self.frames, poses):
            for link in self.links:
                T = frames[link.name]
                corners += [shape.corners @ T[:3, :3].T + T[:3, 3] for shape in link.shapes]
        points = np.concatenate(corners)
        return points.min(axis=0), points.max(axis=0)

    @cached_property
    def collides(self) -> bool:
        """True if any link has a collision shape."""
        return any(link.collisions for link in self.links)

    def bodies(self, link: Link) -> tuple[Visual, ...]:
        """Return the shapes of ``link`` that are checked for contacts.

        These are its collision shapes, or what is drawn if no link of the robot has any.
        """
        if self.collides:
            return link.collisions
        return tuple(visual for visual in link.visuals if not visual.is_rod)

    @cached_property
    def moving(self) -> frozenset[str]:
        """Names of the links that a driven joint moves, directly or through their parents."""
        moving: set[str] = set()
        for link in self.links:
            joint = link.joint
            moved = joint is not None and (self.arm is None or self.arm.moves(joint.name))
            if moved or link.parent in moving:
                moving.add(link.name)
        return frozenset(moving)

    def joint_values(self, q: FloatArray, gripper: float) -> dict[str, float]:
        """Return the value of every movable joint [rad] or [m].

        Args:
            q: (n,) values of the axes of the arm; without an arm, of the driven joints.
            gripper: value of the driven finger joint of the arm.
        """
        if self.arm is None:
            return self.every(dict(zip(self.driven, q.tolist(), strict=True)))
        return self.arm.joint_values(q, gripper)

    def distance(self, q: FloatArray, to: FloatArray) -> float:
        """Return the maximum distance of a link's origin between two postures of the joints [m]."""
        start_frames, end_frames = (
            self.frames(self.joint_values(posture, 0.0)) for posture in (q, to)
        )
        return max(
            math.dist(start_frames[name][:3, 3], end_frames[name][:3, 3]) for name in start_frames
        )

    @cached_property
    def joint_group(self) -> JointSet:
        """The driven joints, with limits that keep their followers inside their limits too.

        An endless joint gets half a turn in each direction. Raises RobotDescriptionError if there
        is no joint to drive, a joint that cannot be moved, or a joint without range.
        """
        self.check_complete()
        driven = [self.joints[name] for name in self.driven]
        if not driven:
            raise RobotDescriptionError(f"{self.name} has no joint that can be driven.")
        ranges = np.array([self._range(joint) for joint in driven])
        return JointSet(
            names=self.driven,
            slides=tuple(joint.slides for joint in driven),
            lower=frozen(ranges[:, 0]),
            upper=frozen(ranges[:, 1]),
            speed=frozen([joint.speed for joint in driven]),
            why=self.why,
        )

    @property
    def joint_labels(self) -> tuple[str, ...]:
        """Label of each joint that is driven: its number, as in messages, and its name.

        Joints of an arm that the file only numbers have the names of a five-axis arm.
        """
        names = self.joint_group.names if self.arm is None else axis_names(self.arm.chain.names)
        return tuple(axis_label(number, name) for number, name in enumerate(names, start=1))

    @property
    def joint_notes(self) -> tuple[str, ...]:
        """Sentences for a person on assumptions about the driven joints."""
        driven = [self.joints[name] for name in self.driven]
        slow = tuple(
            f"Joint {joint.name!r} has no speed in its file; it gets {joint.speed:g} "
            f"{'m/s' if joint.slides else 'rad/s'}."
            for joint in driven
            if not joint.has_speed
        )
        return slow + tuple(
            f"The limits of the joints that follow {joint.name!r} exclude each other, so only its "
            "own are kept."
            for joint in driven
            if not operator.lt(*self._common_range(joint)) and joint.lower < joint.upper
        )

    def _common_range(self, driven: Joint) -> tuple[float, float]:
        """Return the range [rad, m] where ``driven`` and its followers are inside their limits.

        The first number is not below the second one if there is no such range.
        """
        low, high = -math.inf, math.inf
        for joint in self.joints.values():
            if joint.leader != driven.name or joint.factor == 0.0:
                continue
            ends = sorted((end - joint.offset) / joint.factor for end in (joint.lower, joint.upper))
            low, high = max(low, ends[0]), min(high, ends[1])
        return low, high

    def _range(self, driven: Joint) -> tuple[float, float]:
        """Return the range [rad, m] of ``driven``."""
        low, high = self._common_range(driven)
        if low >= high:
            low, high = driven.lower, driven.upper
        if not driven.slides:
            low = -math.pi if low == -math.inf else low
            high = math.pi if high == math.inf else high
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise RobotDescriptionError(
                f"Joint {driven.name!r} of {self.name} cannot be driven: its range is {low:g} to "
                f"{high:g}. Set the lower below the upper limit."
            )
        return low, high


FLANGE = "flange"
"""The tool frame that remains."""


def bare(robot: Robot) -> Robot:
    """Return ``robot`` without the links that carry its fingers; the flange is its only tool.

    Raises RobotDescriptionError if it has no arm, or no link of that name.
    """
    arm = robot.require_arm()
    if FLANGE not in arm.tools:
        raise RobotDescriptionError(
            f"{robot.name} has no link {FLANGE!r}, which marks where its gripper begins."
        )
    chain = arm.chain_to(FLANGE)
    parents = {link.name: link.parent for link in robot.links}
    fingers = {link.name for link in robot.links if link.joint and link.joint.name in arm.fingers}
    # The links between the fingers and the last axis of the arm are removed too.
    carried = {link.name for link in robot.links if link.joint and link.joint.name in chain.names}
    removed = set(fingers)
    for name in fingers:
        above = parents[name]
        while above is not None and above not in carried:
            removed.add(above)
            above = parents[above]
    links = []
    for link in robot.links:
        if link.name in removed or link.parent in removed:
            removed.add(link.name)
        else:
            links.append(link)
    bare_arm = replace(
        arm,
        chain=chain,
        tools={FLANGE: arm.tools[FLANGE]},
        default_tool=FLANGE,
        gripper=NO_GRIPPER,
        fingers={},
    )
    return replace(robot, links=tuple(links), arm=bare_arm)


def loads_of(robot: Robot) -> tuple[LinkLoad, ...]:
    """Return one load for each rigid group of the arm, with its fingers at zero.

    Empty if the file states no mass, or if there is no arm.
    """
    arm = robot.arm
    if arm is None:
        return ()
    T_shoulder_link: dict[str | None, FloatArray] = {None: se3.inverse(arm.T_base_shoulder)}
    axes: dict[str | None, int] = {None: 0}
    moments: dict[int, FloatArray] = {}
    for link in robot.links:
        T = T_shoulder_link[link.name] = T_shoulder_link[link.parent] @ link.at_rest(arm.resting)
        turned = link.joint is not None and link.joint.name in arm.chain.names
        count = axes[link.name] = axes[link.parent] + turned
        if link.inertial is None:
            continue
        # The fourth entry is the mass itself.
        moment = link.inertial.mass * (T @ link.inertial.T_link_inertia[:, 3])
        moments[count] = moments.get(count, np.zeros(4)) + moment
    return tuple(
        LinkLoad(count, float(moment[3]), frozen(moment[:3] / moment[3]))
        for count, moment in moments.items()
    )
