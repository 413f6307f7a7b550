"""The errors a person may meet: whole sentences that say what is wrong, where, what to do."""

from __future__ import annotations


class KatanaError(Exception):
    """Base of every error of this project; its text can be shown to a person as it stands."""


class InputError(KatanaError, ValueError):
    """A value handed in cannot be used: not finite, of the wrong shape, not a rotation, ..."""


class CancelledError(KatanaError):
    """A calculation was ended before it had a result."""


class BlockedError(InputError):
    """A way that is asked for would bring two objects too near to each other."""


class RobotDescriptionError(KatanaError):
    """The description of the robot is broken, or of an arm these kinematics do not cover."""


class ConfigurationError(KatanaError):
    """A setting of the program is missing or contradicts another."""


class LeaseError(KatanaError):
    """Somebody asked of the lease of the arm what is not theirs to ask."""


def digits_beyond(value: float, lower: float, upper: float) -> str:
    """Return ``value`` with the digits, four or more, that show it is not from lower to upper."""
    for digits in range(4, 17):
        text = f"{value:.{digits}g}"
        if not lower <= float(text) <= upper:
            return text
    return repr(value)
