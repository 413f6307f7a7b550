"""The arms of bus servos that can be driven."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from katana450.extensions.motor_bus.dynamixel import DYNAMIXEL
from katana450.extensions.motor_bus.feetech import FEETECH
from katana450.extensions.motor_bus.packets import ServoMake


@dataclass(frozen=True)
class ServoArm:
    """One kind of arm.

    Attributes:
        name: for people, with its article.
        make: its servos.
        models: numbers of the models of its servos, in the order of the joints.
        first_id: id of its first motor as LeRobot expects it; the others follow.
        whole_turns: numbers of the motors, from 0, of a Dynamixel arm that LeRobot calibrates to
            a whole turn.
    """

    name: str
    make: ServoMake
    models: tuple[int, ...]
    first_id: int = 1
    whole_turns: Collection[int] = ()


STS3215, XL430, XL330 = 777, 1060, 1200
"""Numbers of models."""

SERVO_ARMS: Mapping[str, ServoArm] = {
    "so101": ServoArm("an SO-100 or SO-101", FEETECH, (STS3215,) * 6),
    "koch": ServoArm("a Koch v1.1", DYNAMIXEL, (XL430,) * 2 + (XL330,) * 4, whole_turns=(0, 4)),
    "omx": ServoArm("an OMX follower", DYNAMIXEL, (XL430,) * 3 + (XL330,) * 3, 11, range(6)),
}
"""The arms by their names in options. The OMX follower is ROBOTIS' arm of five axes."""
