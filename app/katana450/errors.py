"""Errors with texts for people: complete sentences on what is wrong, where, and what to do."""

from __future__ import annotations

from collections.abc import Sequence


class KatanaError(Exception):
    """Base class of all errors of this project; the text can be shown to a person unchanged."""

    noted = False
    """Whether the event log has a record of this error."""


class InputError(KatanaError, ValueError):
    """A value from outside is unusable: not finite, of the wrong shape, not a rotation, ..."""

    def after(self, introduction: str) -> InputError:
        """Return the error with ``introduction`` before its text."""
        return InputError(f"{introduction}: {self}")


class CancelledError(KatanaError):
    """A calculation was cancelled before it had a result."""


class PathError(InputError):
    """A path cannot be followed at one of its points.

    Attributes:
        text: the text, with ``{point}`` where the point stands, and ``{parts}`` for the bodies.
        point: (3,) the tool point there [m]; empty if the text has none.
        frame: name of its frame.
        parts: names of the two bodies that meet; empty if the text names none.
    """

    def __init__(
        self,
        text: str,
        point: Sequence[float] = (),
        frame: str = "{S}",
        parts: Sequence[str] = (),
    ) -> None:
        """Name ``point`` and ``parts`` in ``text``; ``frame``: name of the frame of the point."""
        self.text, self.point, self.frame, self.parts = text, point, frame, parts
        shown = ", ".join(f"{1e3 * coordinate:.1f}" for coordinate in point)
        text = text.replace("{point}", f"({shown}) mm in {frame}")
        super().__init__(text.replace("{parts}", " and ".join(parts)))

    def after(self, introduction: str) -> PathError:
        """Return the error with ``introduction`` before its text, and the point still apart."""
        return PathError(f"{introduction}: {self.text}", self.point, self.frame, self.parts)


class BlockedError(PathError):
    """The requested path brings two bodies too close together."""


class RobotDescriptionError(KatanaError):
    """The robot description is invalid, or the kinematics do not support its arm."""


class ConfigurationError(KatanaError):
    """A setting of the program is missing or contradicts another one."""


class LeaseError(KatanaError):
    """The caller does not hold the lease of the arm, or may not take it."""


class LateError(LeaseError):
    """A sample of a motion came too late to be executed; another one can be sent soon."""


def digits_beyond(value: float, lower: float, upper: float) -> str:
    """Return ``value`` with four or more digits, enough to show that it is outside the bounds."""
    for digits in range(4, 17):
        text = f"{value:.{digits}g}"
        if not lower <= float(text) <= upper:
            return text
    return repr(value)
