"""The driver of a Katana450: a thread of its own exchanges requests with the arm."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.real_arm.driver.machine import ArmMachine
from katana450.extensions.real_arm.driver_thread import IDLE_TIME, SHORTEST_RETRY, DriverThread
from katana450.extensions.real_arm.encoder_map import EncoderMap
from katana450.extensions.real_arm.link import (
    PORT,
    ArmLink,
    ArmRefusalError,
    ExchangeLog,
    open_arm,
)
from katana450.extensions.real_arm.tool_travel import Travel, tool_travel
from katana450.extras import require
from katana450.maths.geometry.arrays import FloatArray

JOINTS = 5


class KatanaDriver(DriverThread[ArmMachine, ArmLink]):
    """A Katana450 behind the protocol of drivers."""

    def __init__(
        self,
        url: DeviceAddress,
        bounds: FloatArray,
        joints: FloatArray,
        travel: Travel | None = None,
        exchange_log: ExchangeLog | None = None,
    ) -> None:
        """Create the driver without a connection.

        Args:
            url: Address of the arm.
            bounds: (2, 6) lower and upper limits of the joints and the finger joint [rad].
            joints: (6,) values of them that are reported before the first measurement [rad].
            travel: Travel of the tool between two postures; None if a stop is measured without it.
            exchange_log: File of all exchanges; None for none.

        Raises ConfigurationError if the limits of the joints are not those of the arm.
        """
        EncoderMap().check_limits(*bounds[:, :JOINTS])
        super().__init__(ArmMachine(bounds, joints, travel), str(url))
        self._url, self._exchange_log = url, exchange_log

    def _open(self) -> ArmLink:
        return ArmLink(open_arm(self._url), self._clock, self._exchange_log)

    def _work(self, link: ArmLink, now: float) -> float:
        """Perform at most one exchange."""
        machine = self._machine
        request = machine.urgent(now) or machine.poll(now)
        if request is None:
            return IDLE_TIME
        sent = self._clock()
        try:
            reply = link.exchange(request)
        except ArmRefusalError as refusal:
            machine.refused(request, refusal.error, self._clock())
        else:
            self._retry = SHORTEST_RETRY
            machine.replied(request, reply, sent, self._clock())
        return 0.0


def driver_of(options: Namespace, robot: Robot, q: FloatArray, gripper: float) -> KatanaDriver:
    """Return the driver of the arm at ``options.device``, without a connection.

    q: (n,) [rad] and gripper [rad] are reported before the first measurement. Raises KatanaError
    for a wrong address, a missing extra, a log that cannot be written, and a robot that is not this
    arm.
    """
    url = DeviceAddress.parse(options.device, PORT)
    if url.port is None:
        # Before the server starts: the driver tries to connect until it is ended.
        require("serial", "serial", "Serial ports")
    exchange_log = None if options.arm_log is None else ExchangeLog(options.arm_log)
    arm = robot.require_arm()
    lower, upper = arm.limits.lower, arm.limits.upper
    bounds = np.array([[*lower, arm.gripper.lower], [*upper, arm.gripper.upper]])
    return KatanaDriver(url, bounds, np.array([*q, gripper]), tool_travel(robot), exchange_log)
