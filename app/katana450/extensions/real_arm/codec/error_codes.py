"""Numbers of the firmware in words."""

from __future__ import annotations

from typing import Final

CRC_ERROR: Final = -12
"""Code for a request whose checksum is wrong. Real arms may answer otherwise: not known."""

INVALID_ARGUMENT: Final = -2
"""Code for a request with a command, a length or a value that the firmware does not know."""

COLLISION_ERROR: Final = -10
"""Code for a collision."""

CAUSES = {
    -1: "it failed",
    INVALID_ARGUMENT: "an argument is invalid",
    -3: "the arm is not in the right state",
    -4: "the type is wrong",
    -5: "a value is out of range",
    -6: "the axis sends no heartbeat",
    -7: "the axis is not operational",
    -8: "the axis cannot move",
    -9: "the axis cannot follow its polynomial",
    COLLISION_ERROR: "the axis collided",
    -11: "an axis failed",
    CRC_ERROR: "the checksum of the request was wrong",
    -13: "a peripheral failed",
}

COMMANDS = {
    "A": "collision detection",
    "B": "master firmware",
    "C": "motor command",
    "D": "axis state",
    "E": "sensors",
    "H": "polynomials",
    "N": "states or positions",
    "S": "axis parameter",
    "T": "digital inputs",
    "V": "slave firmware",
    "X": "command table",
    "Y": "identity",
    "Z": "echo",
}


def error_sentence(command: int, code: int, axis: int, text: str) -> str:
    """Return a firmware error as a sentence for people.

    Args:
        command: First byte of the refused request.
        code: Number of the error.
        axis: Axis as the firmware counts, 0 for none. Real arms also send numbers above 6.
        text: Words of the firmware, which may be empty.
    """
    name = COMMANDS.get(chr(command), f"0x{command:02X}")
    where = f", axis {axis}" if 1 <= axis <= 6 else ""
    cause = CAUSES.get(code, f"error {code}")
    words = f" ({text!r})" if text else ""
    return f"The arm refused a request ({name}{where}): {cause}{words}."
