"""The driver of ``katana450 serve --arm``."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.extensions.real_arm.driver.katana_driver import KatanaDriver
from katana450.extensions.real_arm.link.arm_url import ArmUrl
from katana450.extensions.real_arm.link.logged import ExchangeLog, LoggedArmUrl
from katana450.extensions.real_arm.tool_travel import tool_travel
from katana450.extras import require
from katana450.maths.geometry.arrays import FloatArray


def driver_of(options: Namespace, robot: Robot, q: FloatArray, gripper: float) -> KatanaDriver:
    """Return the driver of the arm at ``options.arm``, without a connection.

    q: (n,) [rad] and gripper [rad] are reported before the first measurement. Raises KatanaError
    for a wrong address, a missing extra, a log that cannot be written, and a robot that is not this
    arm.
    """
    url = ArmUrl.parse(options.arm)
    if url.port is None:
        # Before the server starts: the driver tries to connect until it is ended.
        require("serial", "serial", "Serial ports")
    if options.arm_log is not None:
        url = LoggedArmUrl(url.host, url.port, ExchangeLog(options.arm_log))
    arm = robot.require_arm()
    bounds = np.array(
        [
            [*arm.limits.lower, arm.gripper.lower],
            [*arm.limits.upper, arm.gripper.upper],
        ]
    )
    joints = np.array([*q, gripper])
    return KatanaDriver(url, bounds, joints, travel=tool_travel(robot))
