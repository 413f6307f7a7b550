"""Classification of the joints of a URDF: the axes that carry the tool, the fingers behind them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from katana450.arm.robot.link import Joint
from katana450.arm.robot.urdf import Urdf, driver_of
from katana450.errors import RobotDescriptionError

TOOL_FRAMES = (
    *("tcp", "grasp", "gripper_frame_link", "ee_gripper_link"),
    *("end_effector_link", "tool_frame", "tool_link", "ee_link", "link_eef", "link_ee"),
    *("tool0", "flange"),
)
"""Links to which targets can refer, if the file has them; the first is the default.

Points between the fingers come first, then ends of the arm, then the place where a tool is mounted:
``tool0`` by the convention of ROS-Industrial, with z out of the flange. The names are those of the
descriptions of Universal Robots, Franka, KUKA, Kinova, UFACTORY, ROBOTIS, Trossen and LeRobot. A
prefix that ends in ``_`` or ``/`` is that of one of several robots, or of the hand.
"""

OWN_TOOL_FRAMES = ("tcp", "grasp", "flange")
"""Tool links by which a file shows that its other joints are fingers."""

TURNING = ("revolute", "continuous")
"""Types of joints of an arm; a continuous one gets half a turn in each direction."""

SLIDING = "prismatic"
"""Type of the joint of a rail or a lift."""

ARM_JOINTS = 5

MIN_ARM_DEPTH = 3
"""Minimum number of consecutive joints of a branch that is an arm, not a finger or a wheel."""

FINGER = re.compile(
    r"finger|gripper|jaw|claw|knuckle|grasp|clamp|pincer|suction|vacuum|rh_[lr]\d", re.IGNORECASE
)
"""Words in the name of a joint or of its link that suggest a finger."""

WRIST = re.compile("wrist|roll|rot|yaw|pitch|twist|tilt|flex", re.IGNORECASE)
"""Words in the name of a joint that turns the gripper and is not a finger."""

JAW_RANGE = 3.0
"""[rad] A joint with a larger range is a wrist, if the arm would be incomplete without it."""

TIP = re.compile(r"tcp|tool|tip|grasp|end_?effector|(^|[_/])ee([_/]|$)", re.IGNORECASE)
"""Words in the name of a frame that is the tool; a joint that moves beside it is a finger."""


@dataclass(frozen=True)
class Structure:
    """The joints that matter for an arm.

    Attributes:
        axes: the joints that carry the tool, from the root: turning ones, after a rail or a lift.
        tools: the tool links, the default one first.
        chosen: whether the default tool is found by the names of other makers or as the outermost
            link, so that fingers are assumed.
        hand: every movable joint behind the last axis, parents first.
        others: every other movable joint.
    """

    axes: tuple[Joint, ...]
    tools: tuple[str, ...]
    chosen: bool
    hand: tuple[Joint, ...]
    others: tuple[Joint, ...]


def structure_of(
    urdf: Urdf, path: Path, tool: str | None, count: int | None = ARM_JOINTS
) -> Structure:
    """Return the structure of the arm in a URDF.

    Args:
        urdf: the robot description.
        path: path of the file, for error messages.
        tool: link to which targets refer by default. None to search the tree for the arm; its tool
            is the first of TOOL_FRAMES that exists, else the outermost link that it carries.
        count: the number of axes that it must have; None for any number.

    Raises:
        RobotDescriptionError: there is no such link, or the arm does not have ``count`` turning
            axes.
    """
    tree = _Tree(urdf)
    if tool is not None and tool not in urdf.links:
        raise RobotDescriptionError(
            f"{path.name} has no link {tool!r}; its links are {', '.join(urdf.links)}."
        )
    axes = _main_axes(tree, path, count) if tool is None else _axes_to(tree, tool, count)
    carried = {
        link: len(tree.joints_to(link))
        for link in urdf.links
        if tree.movable_to(link) == axes
        and all(j.type in (*TURNING, "fixed") or j is axes[0] for j in tree.joints_to(link))
    }
    named = [link for frame in TOOL_FRAMES for link in carried if _is_called(link, frame)]
    if tool is not None:
        tools = [tool, *(link for link in named if link != tool)]
    else:
        leaf = {link: link not in tree.below for link in carried}
        tools = named or [max(carried, key=lambda link: (carried[link], leaf[link]))]
    hand = [j for link in tree.order(axes[-1].child) for j in tree.below.get(link, ()) if _moves(j)]
    others = [j for j in urdf.joints.values() if _moves(j) and j not in axes and j not in hand]
    chosen = tool is None and tools[0] not in OWN_TOOL_FRAMES
    return Structure(tuple(axes), tuple(tools), chosen, tuple(hand), tuple(others))


class _Tree:
    """The joints of a URDF by the links they connect."""

    def __init__(self, urdf: Urdf) -> None:
        self._above = {joint.child: joint for joint in urdf.joints.values()}
        self.joints = urdf.joints
        self.below: dict[str, list[Joint]] = {}
        for joint in urdf.joints.values():
            self.below.setdefault(joint.parent, []).append(joint)
        self.root = next(link for link in urdf.links if link not in self._above)
        self._depth: dict[str, int] = {}
        for link in reversed(self.order(self.root)):
            self._depth[link] = max(
                (self._depth[j.child] + _drives(j) for j in self.below.get(link, ())), default=0
            )

    def joints_to(self, link: str) -> list[Joint]:
        """Return the joints from the root to ``link``, in that order."""
        joints: list[Joint] = []
        while link in self._above:
            joints.append(self._above[link])
            link = joints[-1].parent
        return joints[::-1]

    def movable_to(self, link: str) -> list[Joint]:
        """Return the joints from the root to ``link`` that are not fixed."""
        return [joint for joint in self.joints_to(link) if _moves(joint)]

    def order(self, link: str) -> list[str]:
        """Return ``link`` and all its descendants, parents first."""
        links = [link]
        for name in links:
            links.extend(joint.child for joint in self.below.get(name, ()))
        return links

    def next_joints(self, link: str) -> list[Joint]:
        """Return the first movable joints behind ``link``, on every branch."""
        joints, waiting = [], list(self.below.get(link, ()))
        for joint in waiting:
            if _moves(joint):
                joints.append(joint)
            else:
                waiting.extend(self.below.get(joint.child, ()))
        return joints

    def depth(self, joint: Joint) -> int:
        """Return the maximum number of consecutive driven joints, beginning with ``joint``."""
        return self._depth[joint.child] + _drives(joint)


def _is_called(link: str, frame: str) -> bool:
    """Return whether ``link`` is called ``frame``, with or without a prefix."""
    return link == frame or link.endswith((f"_{frame}", f"/{frame}"))


def _moves(joint: Joint) -> bool:
    return bool(joint.type != "fixed")


def _drives(joint: Joint) -> bool:
    return _moves(joint) and joint.mimic is None


def _is_driven(axes: Sequence[Joint], count: int | None) -> bool:
    """Return whether a tool is driven by ``axes``: they turn, after a rail or a lift at most.

    The family, with ``count`` axes, has none.
    """
    slides = count is None and axes[0].type == SLIDING and axes[0].limit is not None
    return all(joint.type in TURNING for joint in axes[int(slides) :])


def _main_axes(tree: _Tree, path: Path, count: int | None) -> list[Joint]:
    """Return the axes of the arm in a tree from which fingers and wheels branch off.

    Raises RobotDescriptionError with the number of axes if it is not ``count``.
    """
    axes: list[Joint] = []
    link = tree.root
    while branches := _branches(tree, link, axes):
        deepest, *rest = sorted(branches, key=tree.depth, reverse=True)
        if rest:
            depth = tree.depth(deepest)
            candidates = [joint.name for joint in branches if tree.depth(joint) == depth]
            if len(candidates) > 1 and depth >= MIN_ARM_DEPTH > len(axes):
                raise RobotDescriptionError(
                    f"{path.name} has {len(candidates)} arms of {len(axes) + depth} joints each, "
                    f"which begin at {', '.join(candidates)}; one of them can be driven by its "
                    "tool. Name the link that is this tool with --tool."
                )
            if len(candidates) > 1 or depth < MIN_ARM_DEPTH or len(axes) >= ARM_JOINTS:
                break
        axes.append(deepest)
        link = deepest.child
    last = axes[-1] if axes and not branches else None
    if last is not None and _is_finger(tree, last, len(axes)):
        axes.pop()
        last = None
    _refuse_followers(axes, "the tool")
    if not axes:
        raise RobotDescriptionError(
            f"{path.name} has no series of joints that carries a tool. "
            f"Its joints are {_listed(tree.joints.values()) or 'none'}."
        )
    number = "1 axis" if len(axes) == 1 else f"{len(axes)} axes"
    if not _is_driven(axes, count):
        raise RobotDescriptionError(
            f"{path.name} has {number} ({_listed(axes)}); a tool is driven only by turning axes, "
            "after one rail or lift at most. "
            "Name a link that only these carry with --tool, or drive it joint by joint."
        )
    if count is not None and len(axes) != count:
        hint = ""
        if len(axes) == ARM_JOINTS + 1 and last is not None and not WRIST.search(last.name):
            hint = f" If {last.name} only opens a gripper, add --tool {last.parent}."
        raise RobotDescriptionError(
            f"{path.name} has {number} ({_listed(axes)}); the closed-form kinematics need five "
            f"turning axes.{hint}"
        )
    return axes


def _listed(joints: Iterable[Joint]) -> str:
    """Return the names of ``joints``, with the type of each that does not turn."""
    return ", ".join(j.name if j.type in TURNING else f"{j.name} ({j.type})" for j in joints)


def _branches(tree: _Tree, link: str, axes: Sequence[Joint]) -> list[Joint]:
    """Return the next joints behind ``link``, without bars of ``axes`` that carry nothing."""
    joints = tree.next_joints(link)
    driven = {joint.name for joint in axes}

    def is_bar(joint: Joint) -> bool:
        leader = driver_of(joint, tree.joints)
        return joint.mimic is not None and leader is not None and leader.joint in driven

    own = [joint for joint in joints if not is_bar(joint) or tree.depth(joint)]
    return own or joints[:1]


def _is_finger(tree: _Tree, joint: Joint, number: int) -> bool:
    """Return whether the last of ``number`` joints opens a gripper instead of turning it."""
    if joint.mimic is not None or joint.type == "prismatic":
        return True
    fixed = [j.child for j in tree.below[joint.parent] if not _moves(j)]
    if any(TIP.search(link) and link not in tree.below for link in fixed):
        return True
    if not FINGER.search(f"{joint.name} {joint.child}") or WRIST.search(joint.name):
        return False
    limit = joint.limit
    if joint.type == "continuous" or limit is None or limit.lower is None or limit.upper is None:
        return True
    return bool(number > ARM_JOINTS or limit.upper - limit.lower <= JAW_RANGE)


def _axes_to(tree: _Tree, tool: str, count: int | None) -> list[Joint]:
    """Return the axes that carry ``tool``. Raises RobotDescriptionError if not ``count``."""
    axes = tree.movable_to(tool)
    _refuse_followers(axes, repr(tool))
    for joint in axes if axes and not _is_driven(axes, count) else ():
        if joint.type not in TURNING:
            raise RobotDescriptionError(
                f"Joint {joint.name!r} is {joint.type}; only turning joints can carry {tool!r}, "
                "after one rail or lift at most."
            )
    if not axes or (count is not None and len(axes) != count):
        raise RobotDescriptionError(
            f"Link {tool!r} is carried by {len(axes)} turning joints "
            f"({', '.join(joint.name for joint in axes)}); "
            "the tool of a five-axis arm is carried by five. Name another link with --tool."
        )
    return axes


def _refuse_followers(axes: Sequence[Joint], what: str) -> None:
    for joint in axes:
        if joint.mimic is not None:
            raise RobotDescriptionError(
                f"Joint {joint.name!r} follows joint {joint.mimic.joint!r}; "
                f"the five axes that carry {what} must each turn by themselves."
            )
