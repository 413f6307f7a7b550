"""The commands of MoveIt Servo: their frames and joints are looked up in the arm as it is now."""

from __future__ import annotations

import time

from katana450.extensions.rosbridge.messages import JointJog, TwistStamped
from katana450.extensions.rosbridge.publications import axis_names, frames
from katana450.extensions.rosbridge.servoing import (
    Units,
    check_fresh,
    joint_rates,
    rotation_of,
    tool_rates,
)
from katana450.extensions.rosbridge.stream import ServoStream
from katana450.maths.kinematics.tool import pitched_frame
from katana450.server.service.hub import Hub


class ServoCommands:
    """Turns messages of one client into motion of its stream."""

    def __init__(self, hub: Hub, stream: ServoStream, units: Units) -> None:
        self._hub = hub
        self._stream = stream
        self._units = units

    def twist(self, message: TwistStamped) -> None:
        """Move the tool. Raises KatanaError if that is refused."""
        check_fresh(message.header, time.time())
        arm = self._hub.present()
        state, mounted = arm.state, arm.arm
        found = frames(arm.robot, arm.robot.joint_values(state.q, state.gripper))
        R = rotation_of(message.header.frame_id, found, arm.robot.links[0].name)
        pitched = None
        if mounted.kinematics_to(state.tool).freedoms == 5:
            pitched = pitched_frame(mounted.chain_to(state.tool), state.q)
        self._stream.tool(tool_rates(message.twist, R, pitched, self._units))

    def jog(self, message: JointJog) -> None:
        """Move joints. Raises KatanaError if that is refused."""
        check_fresh(message.header, time.time())
        names = axis_names(self._hub.present().robot)
        self._stream.joints(joint_rates(message, names, self._units))
