"""The same robot without its gripper, as the paper's experiments have it."""

from __future__ import annotations

from dataclasses import replace

from katana450.arm.control.arm import NO_GRIPPER
from katana450.arm.robot.robot import Robot
from katana450.errors import RobotDescriptionError

FLANGE = "flange"
"""The tool frame that is left."""


def bare(robot: Robot) -> Robot:
    """Return ``robot`` without the links that carry its fingers, the flange its only tool.

    Raises RobotDescriptionError where it has no arm, or no link of that name.
    """
    arm = robot.require_arm()
    if FLANGE not in arm.tools:
        raise RobotDescriptionError(
            f"{robot.name} has no link {FLANGE!r}, so nobody can say where its gripper begins."
        )
    chain = arm.chain_to(FLANGE)
    parents = {link.name: link.parent for link in robot.links}
    fingers = {link.name for link in robot.links if link.joint and link.joint.name in arm.fingers}
    # What carries the fingers, down to the last axis of the arm.
    carried = {link.name for link in robot.links if link.joint and link.joint.name in chain.names}
    gone = set(fingers)
    for name in fingers:
        above = parents[name]
        while above is not None and above not in carried:
            gone.add(above)
            above = parents[above]
    left = []
    for link in robot.links:
        if link.name in gone or link.parent in gone:
            gone.add(link.name)
        else:
            left.append(link)
    plain = replace(
        arm,
        chain=chain,
        tools={FLANGE: arm.tools[FLANGE]},
        default_tool=FLANGE,
        gripper=NO_GRIPPER,
        fingers={},
    )
    return replace(robot, links=tuple(left), arm=plain)
