"""The robot without its gripper, as in the paper's experiments."""

from __future__ import annotations

from dataclasses import replace

from katana450.arm.control.objects.gripper_model import NO_GRIPPER
from katana450.arm.robot.robot import Robot
from katana450.errors import RobotDescriptionError

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
