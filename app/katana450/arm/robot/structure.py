"""The joints of a URDF told apart: the axes that carry the tool, the fingers behind them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from katana450.arm.robot.urdf import Urdf, UrdfJoint
from katana450.errors import RobotDescriptionError

TOOL_FRAMES = ("tcp", "grasp", "flange")
"""Links that targets can be set for where the file has them; the first is the default."""

TURNING = ("revolute", "continuous")
"""Types of joint an arm is made of; a continuous one is given half a turn either way."""

ARM_JOINTS = 5

MIN_ARM_DEPTH = 3
"""Joints in a row from which a branch of the tree is an arm, and not a finger or a wheel."""

FINGER = re.compile(r"finger|gripper|jaw|claw|knuckle|grasp|clamp|pincer|rh_[lr]\d", re.IGNORECASE)
"""In the name of a joint or of its link: it may be that of a finger."""

WRIST = re.compile("wrist|roll|rot|yaw|pitch|twist|tilt|flex", re.IGNORECASE)
"""In the name of a joint: it turns the gripper and is none of its fingers."""

JAW_RANGE = 3.0
"""[rad] A joint that turns farther is that of a wrist, if an arm has none without it."""

TIP = re.compile(r"tcp|tool|tip|grasp|end_?effector|(^|[_/])ee([_/]|$)", re.IGNORECASE)
"""In the name of a frame: it is the tool, and what moves beside it is a finger."""


@dataclass(frozen=True)
class Structure:
    """The joints that matter for an arm.

    Attributes:
        axes: the five turning joints that carry the tool, from the root.
        tools: the tool links, the default one first.
        chosen: whether the default tool is only the outermost link, named by nobody.
        hand: every movable joint behind the last axis, parents first.
        others: every other movable joint.
    """

    axes: tuple[UrdfJoint, ...]
    tools: tuple[str, ...]
    chosen: bool
    hand: tuple[UrdfJoint, ...]
    others: tuple[UrdfJoint, ...]


def structure_of(urdf: Urdf, path: Path, tool: str | None) -> Structure:
    """The structure of the arm in a URDF.

    Args:
        path: of the file, for error messages.
        tool: link that targets are set for by default; else the arm is looked for in the tree, and
            its tool is the first of TOOL_FRAMES there is, else the outermost link it carries.

    Raises:
        RobotDescriptionError: there is no such link, or the arm has not five turning axes.
    """
    tree = _Tree(urdf)
    if tool is not None and tool not in urdf.links:
        raise RobotDescriptionError(
            f"{path.name} has no link {tool!r}; its links are {', '.join(urdf.links)}."
        )
    axes = _main_axes(tree, path) if tool is None else _axes_to(tree, tool)
    carried = {
        link: len(tree.joints_to(link))
        for link in urdf.links
        if tree.movable_to(link) == axes and all(_carries(j) for j in tree.joints_to(link))
    }
    named = [link for link in TOOL_FRAMES if link in carried]
    if tool is not None:
        tools = [tool, *(link for link in named if link != tool)]
    else:
        leaf = {link: link not in tree.below for link in carried}
        tools = named or [max(carried, key=lambda link: (carried[link], leaf[link]))]
    hand = [j for link in tree.order(axes[-1].child) for j in tree.below.get(link, ()) if _moves(j)]
    others = [j for j in urdf.joints.values() if _moves(j) and j not in axes and j not in hand]
    chosen = tool is None and not named
    return Structure(tuple(axes), tuple(tools), chosen, tuple(hand), tuple(others))


class _Tree:
    """The joints of a URDF by the links they connect."""

    def __init__(self, urdf: Urdf) -> None:
        self._above = {joint.child: joint for joint in urdf.joints.values()}
        self.joints = urdf.joints
        self.below: dict[str, list[UrdfJoint]] = {}
        for joint in urdf.joints.values():
            self.below.setdefault(joint.parent, []).append(joint)
        self.root = next(link for link in urdf.links if link not in self._above)
        self._depth: dict[str, int] = {}
        for link in reversed(self.order(self.root)):
            self._depth[link] = max(
                (self._depth[j.child] + _drives(j) for j in self.below.get(link, ())), default=0
            )

    def joints_to(self, link: str) -> list[UrdfJoint]:
        """The joints from the root to ``link``, in that order."""
        joints: list[UrdfJoint] = []
        while link in self._above:
            joints.append(self._above[link])
            link = joints[-1].parent
        return joints[::-1]

    def movable_to(self, link: str) -> list[UrdfJoint]:
        """Those of them that are not fixed."""
        return [joint for joint in self.joints_to(link) if _moves(joint)]

    def order(self, link: str) -> list[str]:
        """``link`` and all that hang on it, parents first."""
        found = [link]
        for name in found:
            found.extend(joint.child for joint in self.below.get(name, ()))
        return found

    def next_joints(self, link: str) -> list[UrdfJoint]:
        """The first movable joints behind ``link``, on every branch."""
        found, waiting = [], list(self.below.get(link, ()))
        for joint in waiting:
            if _moves(joint):
                found.append(joint)
            else:
                waiting.extend(self.below.get(joint.child, ()))
        return found

    def depth(self, joint: UrdfJoint) -> int:
        """How many driven joints are in a row from ``joint`` on, at most."""
        return self._depth[joint.child] + _drives(joint)

    def leader(self, joint: UrdfJoint) -> UrdfJoint | None:
        """The driven joint that ``joint`` follows, directly or not; None if there is none."""
        passed: list[str] = []
        led: UrdfJoint | None = joint
        while led is not None and led.mimic is not None:
            if led.name in passed:
                return None
            passed.append(led.name)
            led = self.joints.get(led.mimic.joint)
        return led


def _moves(joint: UrdfJoint) -> bool:
    return bool(joint.type != "fixed")


def _drives(joint: UrdfJoint) -> bool:
    return _moves(joint) and joint.mimic is None


def _carries(joint: UrdfJoint) -> bool:
    return joint.type in (*TURNING, "fixed")


def _main_axes(tree: _Tree, path: Path) -> list[UrdfJoint]:
    """The five axes of the arm in a tree, where fingers and wheels branch off.

    Raises RobotDescriptionError that says how many axes there are.
    """
    axes: list[UrdfJoint] = []
    link = tree.root
    while branches := _branches(tree, link, axes):
        deepest, *rest = sorted(branches, key=tree.depth, reverse=True)
        if rest:
            depth = tree.depth(deepest)
            rivals = [joint.name for joint in branches if tree.depth(joint) == depth]
            if len(rivals) > 1 and depth >= MIN_ARM_DEPTH > len(axes):
                hint = ""
                if len(axes) + depth >= ARM_JOINTS:
                    hint = " Name the link that is the tool of one of them with --tool."
                raise RobotDescriptionError(
                    f"{path.name} has {len(rivals)} arms of {len(axes) + depth} joints each, which "
                    f"begin at {', '.join(rivals)}; the closed-form kinematics need one arm of "
                    f"five turning axes.{hint}"
                )
            if len(rivals) > 1 or depth < MIN_ARM_DEPTH or len(axes) >= ARM_JOINTS:
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
            f"{path.name} has no joints in a row that carry a tool; the closed-form kinematics "
            f"need five turning axes. Its joints are {_listed(tree.joints.values()) or 'none'}."
        )
    if len(axes) != ARM_JOINTS:
        hint = ""
        if len(axes) == ARM_JOINTS + 1 and last is not None and not WRIST.search(last.name):
            hint = f" If {last.name} only opens a gripper, add --tool {last.parent}."
        count = "1 axis" if len(axes) == 1 else f"{len(axes)} axes"
        raise RobotDescriptionError(
            f"{path.name} has {count} ({_listed(axes)}); the closed-form kinematics need five "
            f"turning axes.{hint}"
        )
    if not all(joint.type in TURNING for joint in axes):
        raise RobotDescriptionError(
            f"The axes of {path.name} are {_listed(axes)}; the closed-form kinematics need five "
            "turning axes."
        )
    return axes


def _listed(joints: Iterable[UrdfJoint]) -> str:
    """The names of ``joints``, with the type of each that does not turn."""
    return ", ".join(j.name if j.type in TURNING else f"{j.name} ({j.type})" for j in joints)


def _branches(tree: _Tree, link: str, axes: Sequence[UrdfJoint]) -> list[UrdfJoint]:
    """The next joints behind ``link``, without the bars that ``axes`` move and that carry none."""
    found = tree.next_joints(link)
    own = [j for j in found if j.mimic is None or tree.leader(j) not in axes or tree.depth(j)]
    return own or found[:1]


def _is_finger(tree: _Tree, joint: UrdfJoint, number: int) -> bool:
    """Whether the last joint of a row of ``number`` opens a gripper instead of turning one."""
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


def _axes_to(tree: _Tree, tool: str) -> list[UrdfJoint]:
    """The five axes that carry the link ``tool``; RobotDescriptionError where they are not."""
    axes = tree.movable_to(tool)
    _refuse_followers(axes, repr(tool))
    for joint in axes:
        if joint.type not in TURNING:
            raise RobotDescriptionError(
                f"Joint {joint.name!r} is {joint.type}; only turning joints can carry {tool!r}."
            )
    if len(axes) != ARM_JOINTS:
        raise RobotDescriptionError(
            f"Link {tool!r} hangs on {len(axes)} turning joints "
            f"({', '.join(joint.name for joint in axes)}); "
            "the tool of a five-axis arm hangs on five. Name another link with --tool."
        )
    return axes


def _refuse_followers(axes: Sequence[UrdfJoint], what: str) -> None:
    for joint in axes:
        if joint.mimic is not None:
            raise RobotDescriptionError(
                f"Joint {joint.name!r} follows joint {joint.mimic.joint!r}; "
                f"the five axes that carry {what} must each turn by themselves."
            )
