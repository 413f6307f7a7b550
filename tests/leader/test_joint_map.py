"""Calibration files, and the posture of the arm that a posture of the leader means."""

from __future__ import annotations

import json
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.leader.joint_map import JointMap
from katana450.extensions.leader.leader_command import prepare
from katana450.extensions.motor_bus.bus import MotorBus, MotorRequestError
from katana450.extensions.motor_bus.calibration import decoded_calibration, read_calibration
from katana450.extensions.motor_bus.feetech import FEETECH
from katana450.extensions.motor_bus.packets import Packet
from katana450.server.api import answers
from tests.leader.emulated_leader import RANGE, EmulatedMotors, calibration

LOWER = (-3.0, -2.1, -2.0, -2.0, -2.8)
UPPER = (2.8, 0.1, 2.2, 1.8, 2.9)
MIDDLE = sum(RANGE) // 2


def arm(*, gripper: bool = True) -> answers.Arm:
    """The description of an arm with rounded limits."""
    numbers = [1.0] * 5
    return answers.Arm(
        name="Arm",
        joints=list("abcde"),
        lower=list(LOWER),
        upper=list(UPPER),
        speed=numbers,
        acceleration=numbers,
        jerk=numbers,
        ready=numbers,
        tools={},
        default_tool=None,
        gripper=(-0.4, 0.3, 0.7) if gripper else None,
        gripper_slides=False,
        suction_cup=False,
        T_base_shoulder=None,
        slides=[False] * 5,
        links=[],
        joints_only="",
    )


def calibrated(**changes: object) -> bytes:
    motors = calibration()
    motors["elbow_flex"] |= changes  # type: ignore[arg-type]
    return json.dumps(motors).encode()


def ticks(*degrees: float) -> dict[int, int]:
    return {i: round((sum(RANGE)) / 2 + angle * 4096 / 360) for i, angle in enumerate(degrees, 1)}


def test_directions_of_the_links_are_those_of_the_leader() -> None:
    joints = JointMap(decoded_calibration(calibrated()), arm())
    posture = joints.posture(ticks(0, 0, 0, 0, 0, 0))
    assert joints.motors == (1, 2, 3, 4, 5, 6)
    # In the middle of all ranges the upper arm rises steeply, forearm and hand are level.
    pitch = np.degrees(np.cumsum(posture.q[1:4]))
    assert pitch == pytest.approx([-76.0, -2.2, 0.0], abs=0.2)
    assert posture.q[[0, 4]] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert posture.finger == pytest.approx(-0.05, abs=1e-3)
    # Each joint of the leader turns one of the arm; pan and roll in the other direction.
    for axis, sign in enumerate((-1, 1, 1, 1, -1)):
        turned = joints.posture(ticks(*(10.0 * (i == axis) for i in range(6)))).raw - posture.raw
        expected = math.radians(10.0) * sign * np.eye(5)[axis]
        assert turned == pytest.approx(expected, abs=2e-3)


def test_posture_stays_within_the_limits_of_the_arm() -> None:
    joints = JointMap(decoded_calibration(calibrated()), arm())
    for way in (-1, 1):
        posture = joints.posture(ticks(*[way * 200.0] * 6))
        assert (posture.q > LOWER).all()
        assert (posture.q < UPPER).all()
        assert np.abs(posture.raw).max() > 3.0
        assert posture.finger == pytest.approx(0.3 if way > 0 else -0.4)


def test_drive_mode_reverses_a_joint() -> None:
    motor = decoded_calibration(calibrated(drive_mode=1))["elbow_flex"]
    assert motor.angle(MIDDLE + 1024) == pytest.approx(-math.pi / 2, abs=1e-3)
    assert motor.fraction(RANGE[0]) == 1.0


def test_arm_without_gripper_needs_no_jaw() -> None:
    joints = JointMap(decoded_calibration(calibrated()), arm(gripper=False))
    assert joints.motors == (1, 2, 3, 4, 5)
    assert joints.posture(ticks(0, 0, 0, 0, 0)).finger is None


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"{", "truncated"),
        (b"[1]", "Expected `object`"),
        (calibrated(range_min=4000), "elbow_flex: range_min 4000 is not below range_max 3395"),
        (calibrated(id=2), "elbow_flex and shoulder_lift have the same id 2"),
        (calibrated(homing_offset="3"), r"Expected `int`, got `str` - at `\$"),
        (calibrated(speed=1), "unknown field `speed`"),
        (calibrated(id=300), "<= 253"),
        (b" " * 65_000, "64000 bytes"),
    ],
)
def test_wrong_calibration_is_refused_with_its_place(data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        decoded_calibration(data)


def test_missing_file_and_missing_motor_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_calibration(tmp_path / "none.json")
    file = tmp_path / "some.json"
    file.write_bytes(b'{"elbow_flex": 3}')
    with pytest.raises(InputError, match=r"some.json is not a calibration file of LeRobot"):
        read_calibration(file)
    known = decoded_calibration(calibrated())
    del known["wrist_flex"]
    with pytest.raises(InputError, match="no motor wrist_flex, but shoulder_pan"):
        JointMap(known, arm())


def test_arm_with_other_joints_is_refused() -> None:
    six = msgspec.structs.replace(arm(), lower=[*LOWER, -1.0])
    with pytest.raises(InputError, match=r"has 6 joints, 0 of which slide\. The leader has 5"):
        JointMap(decoded_calibration(calibrated()), six)


class WiredPort:
    """A port with the emulated motors behind it, which gives the bytes in small parts."""

    def __init__(self) -> None:
        self.motors = EmulatedMotors()
        self._waiting = b""
        self.noise = b""

    def write(self, data: bytes, timeout: float) -> None:
        assert timeout > 0.0
        self._waiting = self.noise + self.motors.answer(data)

    def read(self, timeout: float) -> bytes:
        assert timeout > 0.0
        data, self._waiting = self._waiting[:3], self._waiting[3:]
        return data

    def close(self) -> None:
        pass


def test_bus_reads_the_motors_through_noise() -> None:
    port = WiredPort()
    bus = MotorBus(port, FEETECH)
    # An adapter may return what was sent, and answers of other motors.
    port.noise = b"\x00\xff\xff" + FEETECH.framing.encoded(Packet(9, 0, b"ab"))
    offsets = [motor["homing_offset"] for motor in calibration().values()]
    assert [bus.read(motor, FEETECH.homing_offset) for motor in range(1, 7)] == offsets
    port.motors.place((0.1, -0.1, 0.2, -0.2, 1.0, -1.0))
    positions = bus.read_all((1, 2, 3, 4, 5, 6), FEETECH.position)
    assert positions[5] - positions[6] == pytest.approx(2.0 * 4096 / (2.0 * math.pi), abs=1.0)
    assert bus.errors(2) == 0


def test_silent_motors_are_named() -> None:
    port = WiredPort()
    for number in (2, 4):
        port.motors.motors[number - 1].silent = True
    bus = MotorBus(port, FEETECH)
    with pytest.raises(MotorRequestError, match="do not answer: 2, 4"):
        bus.read_all((1, 2, 3, 4), FEETECH.position)
    with pytest.raises(MotorRequestError, match="do not answer: 4"):
        bus.read(4, FEETECH.homing_offset)


def test_torque_is_switched_off_only_with_the_calibration_of_this_leader() -> None:
    port = WiredPort()
    known = decoded_calibration(calibrated())
    prepare(MotorBus(port, FEETECH), known, (1, 2, 3, 4, 5, 6))
    assert not any(port.motors.torque)
    port.motors.motors[2][FEETECH.torque_enable] = 1
    other = decoded_calibration(calibrated(homing_offset=5))
    with pytest.raises(InputError, match="elbow_flex is 0 in the motor and 5 in the calibration"):
        prepare(MotorBus(port, FEETECH), other, (3,))
    assert port.motors.torque[2]
