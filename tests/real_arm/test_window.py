"""The page of the emulator shows the arm where it really is, whatever anybody believes."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.extensions.real_arm.codec.requests import CommandMotor, MotorFlag
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.firmware import Firmware
from katana450.extensions.real_arm.emulator.posture import joints_at
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from katana450.extensions.real_arm.emulator.window import ArmWindow
from katana450.maths.geometry import so3
from tests.viser_bridge.internals import nodes


def until(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_window_shows_the_arm_where_it_really_is(robot: Robot) -> None:
    arm = EmulatedArm(calibrated=True)
    server = EmulatorServer(arm, "127.0.0.1", 0)
    window = ArmWindow(server, robot, "127.0.0.1", 0)
    server.start()
    try:
        joint = next(link for link in robot.links if link.joint is not None)
        assert joint.joint is not None

        def shown() -> float:
            """Return the angle of the first joint as drawn [rad]."""
            (name,) = (n for n in nodes(window._server) if n.endswith(f"/{joint.name}"))
            R = so3.from_quaternion(nodes(window._server)[name].wxyz)
            turned = joint.T_parent_link[:3, :3].T @ R
            assert joint.joint is not None
            return float(so3.log(turned) @ joint.joint.axis)

        def real() -> float:
            with server.lock:
                return float(joints_at(arm.counts)[0][0])

        def drawn() -> bool:
            return abs((shown() - real() + np.pi) % (2.0 * np.pi) - np.pi) < 1e-3

        until(drawn)
        before = real()
        with server.lock:
            Firmware(arm).answer(CommandMotor(1, MotorFlag.MOVE, 20_000))
        until(lambda: arm.axes[0].plant.speed == 0.0 and abs(real() - before) > 1.0)
        until(drawn)
        axis = arm.axes[0]
        until(lambda: f"| 1 | {axis.position} | it holds its position |" in window._text.content)
        assert "This arm is calibrated." in window._text.content
        # Nobody is connected when the power fails and comes back.
        with server.lock:
            arm.switch_off()
            arm.switch_on()
        until(lambda: "This arm is not calibrated." in window._text.content)
        until(drawn)
    finally:
        window.close()
        server.stop()
