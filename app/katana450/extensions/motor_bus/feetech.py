"""Feetech STS3215 servos.

A packet is ``FF FF id length code parameters checksum``. Its code is an instruction from the host,
or the errors of a motor. Source: the memory table and protocol of Feetech's STS series.
"""

from __future__ import annotations

from katana450.extensions.motor_bus.packets import Framing, Register, ServoMake

HEADER = b"\xff\xff"


def checksum(data: bytes) -> int:
    """Return the checksum of the bytes ``data`` with their header."""
    return ~sum(data[len(HEADER) :]) & 0xFF


TORQUE_LIMIT, FULL_FORCE = Register(48, 2), 1000
"""[1/1000 of the largest torque]"""

ACCELERATION, MAX_ACCELERATION = Register(41, 1), 254
"""[100 ticks/s^2] The largest value is written: the setpoints are smooth."""

FEETECH = ServoMake(
    framing=Framing(HEADER, 1, checksum),
    # The major part of the version is in the low byte.
    firmware=Register(0, 2),
    model=Register(3, 2),
    id=Register(5, 1),
    drive_mode=None,
    mode=Register(33, 1),
    # Actual minus reported position.
    homing_offset=Register(31, 2, 11),
    min_position=Register(9, 2, 15),
    max_position=Register(11, 2, 15),
    torque_enable=Register(40, 1),
    goal_position=Register(42, 2, 15),
    position=Register(56, 2, 15),
    speed=Register(58, 2, 15),
    load=Register(60, 2, 10),
    voltage=Register(62, 1),
    temperature=Register(63, 1),
    units=(1.0, 1.0, 1e-3, 0.1, 1.0),
    modes=(0,),
    counts_turns=False,
    # The jaw presses with half of its force, as LeRobot lets it.
    settings=((TORQUE_LIMIT, FULL_FORCE), (ACCELERATION, MAX_ACCELERATION)),
    jaw_settings=((TORQUE_LIMIT, FULL_FORCE // 2), (ACCELERATION, MAX_ACCELERATION)),
    force_limit=TORQUE_LIMIT,
    full_force=FULL_FORCE,
    errors={0x20: "overload", 0x04: "heat", 0x01: "voltage", 0x08: "current", 0x02: "sensor"},
)
