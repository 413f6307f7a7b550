"""Recent presses of STOP, each of which counts once."""

from __future__ import annotations

from collections import deque

from katana450.arm.control.commands.commands import Stop

REMEMBERED = 256
"""Number of presses of STOP whose repetitions are recognised."""


class Presses:
    """Recent presses of STOP, each of which counts once."""

    def __init__(self) -> None:
        self._counted: deque[str] = deque(maxlen=REMEMBERED)

    def is_known(self, press: str | None) -> bool:
        """Return whether ``press`` was counted. A press without a name is always new."""
        return press is not None and press in self._counted

    def counts(self, stop: Stop) -> bool:
        """Remember the presses of ``stop``; return whether any is new.

        A stop whose cause names no press always counts.
        """
        new = [press for press in stop.presses if press not in self._counted]
        self._counted.extend(new)
        return bool(new) or not stop.cause.press
