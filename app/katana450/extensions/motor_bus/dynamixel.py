"""Dynamixel servos of the X series, such as XL330, XL430 and XM430.

A packet of protocol 2 is ``FF FF FD 00 id length code parameters CRC``, with length and CRC of two
bytes. Source: ROBOTIS' manuals of the protocol and of these motors.
"""

from __future__ import annotations

from katana450.extensions.motor_bus.packets import Framing, Register, ServoMake

POLYNOMIAL = 0x8005


def _crc_of_byte(byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ (POLYNOMIAL if crc & 0x8000 else 0)) & 0xFFFF
    return crc


CRC_TABLE = tuple(map(_crc_of_byte, range(256)))


def crc16(data: bytes) -> int:
    """Return the CRC-16 of ``data``: initial value 0, not reflected."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ CRC_TABLE[crc >> 8 ^ byte]
    return crc


ACCESS_ERROR = 7
"""Refusal of what cannot be written, such as what is kept without power while the motor holds."""

SHUTDOWN, KEPT_BYTES = Register(63, 1), 64
"""Errors at which a motor goes limp, and the number of bytes that it keeps without power."""

PROFILES_OFF = ((Register(108, 4), 0), (Register(112, 4), 0))
"""Acceleration and velocity without a profile: the setpoints are smooth."""

GOAL_PWM, FULL_PWM = Register(100, 2, complement=True), 885
"""Fraction of the voltage that a motor applies at most, and its value for the whole voltage."""

POSITION_MODE, EXTENDED_POSITION_MODE, CURRENT_POSITION_MODE = 3, 4, 5

DYNAMIXEL = ServoMake(
    framing=Framing(b"\xff\xff\xfd\x00", 2, crc16, stuffed=b"\xff\xff\xfd", status=0x55),
    model=Register(0, 2),
    firmware=Register(6, 1),
    id=Register(7, 1),
    drive_mode=Register(10, 1),
    mode=Register(11, 1),
    # Reported minus actual position.
    homing_offset=Register(20, 4, complement=True),
    max_position=Register(48, 4),
    min_position=Register(52, 4),
    torque_enable=Register(64, 1),
    goal_position=Register(116, 4, complement=True),
    # The applied fraction of the voltage: some motors measure no current.
    load=Register(124, 2, complement=True),
    speed=Register(128, 4, complement=True),
    position=Register(132, 4, complement=True),
    voltage=Register(144, 2),
    temperature=Register(146, 1),
    # The speed counts 0.229 turns a minute.
    units=(1.0, 0.229 * 4096 / 60.0, 1.0 / FULL_PWM, 0.1, 1.0),
    modes=(POSITION_MODE, EXTENDED_POSITION_MODE, CURRENT_POSITION_MODE),
    counts_turns=True,
    settings=PROFILES_OFF,
    jaw_settings=((GOAL_PWM, FULL_PWM // 2), *PROFILES_OFF),
    force_limit=GOAL_PWM,
    full_force=FULL_PWM,
    errors={0x20: "overload", 0x04: "heat", 0x01: "voltage", 0x10: "shock", 0x08: "sensor"},
    hardware_error=Register(70, 1),
    alert=0x80,
    refusal=0x7F,
)
