"""The same robot without its gripper, as the paper's experiments have it."""

from __future__ import annotations

from dataclasses import replace

from katana450.arm.control.arm import NO_GRIPPER
from katana450.arm.robot.model import RobotModel
from katana450.errors import RobotDescriptionError

FLANGE = "flange"
"""The tool frame that is left."""


def bare(model: RobotModel) -> RobotModel:
    """`model` without the links that carry its fingers, and with the flange as its only tool.

    Raises RobotDescriptionError where the description names no flange.
    """
    if FLANGE not in model.arm.tools:
        raise RobotDescriptionError(
            f"{model.name} has no link {FLANGE!r}, so nobody can say where its gripper begins."
        )
    chain = model.arm.chain_to(FLANGE)
    parents = {body.name: body.parent for body in model.bodies}
    fingers = {body.name for body in model.bodies if body.joint in model.fingers}
    # What carries the fingers, down to the last axis of the arm.
    carried = {body.name for body in model.bodies if body.joint in chain.names}
    gone = set(fingers)
    for name in fingers:
        above = parents[name]
        while above is not None and above not in carried:
            gone.add(above)
            above = parents[above]
    left = []
    for body in model.bodies:
        if body.name in gone or body.parent in gone:
            gone.add(body.name)
        else:
            left.append(body)
    tools = {FLANGE: model.arm.tools[FLANGE]}
    arm = replace(model.arm, chain=chain, tools=tools, default_tool=FLANGE, gripper=NO_GRIPPER)
    return replace(model, arm=arm, bodies=tuple(left), fingers={})
