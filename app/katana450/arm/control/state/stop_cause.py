"""Cause of a stop: the person or the watchdog, the reason, and the press of STOP."""

from __future__ import annotations

from dataclasses import dataclass

UNNAMED = "Somebody"
"""Name of a presser whose own name is not known where STOP arrives."""


@dataclass(frozen=True)
class StopCause:
    """Cause of a stop.

    Attributes:
        why: reason in words.
        by: name of the participant that pressed STOP; None if a watchdog stopped the arm.
        key: identity of that participant, as ``Person.key``; not shown to people.
        press: name of the press, which counts once on all paths; a stop without one always counts.
        at: time of the stop [s since the epoch]; 0 if it is not known.
    """

    why: str = "The arm lost the connection to the server and stopped."
    by: str | None = None
    key: str = ""
    press: str = ""
    at: float = 0.0

    def lacks_name_of(self, copy: StopCause) -> bool:
        """Return whether ``copy`` is of the same press and alone has the name of its presser."""
        return self.by == UNNAMED != copy.by and (self.press, self.key) == (copy.press, copy.key)


WATCHDOG = StopCause()
"""Cause of a stop by the arm's process itself, which no longer hears the server."""


def pressed(name: str, key: str, press: str | None, time: float) -> StopCause:
    """Return the cause of a stop by the participant ``name`` at ``time`` [s since the epoch]."""
    return StopCause(f"{name} pressed STOP.", name, key, press or "", time)
