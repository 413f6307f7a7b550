"""News of the stop, for clients that would otherwise learn of it later."""

from __future__ import annotations

from collections.abc import Callable

from katana450.server.service.stop_state import StopRecord


class StopNews:
    """Calls listeners when a stop begins, is confirmed for the first time, or is cleared.

    A repeated press is no news, so that a flood of STOP causes no flood of messages.
    """

    def __init__(self) -> None:
        self.listeners: set[Callable[[], None]] = set()
        """Called without arguments, in the thread of ``note``."""
        self._shown = (False, False)

    def note(self, stopped: StopRecord | None) -> None:
        """Call the listeners if ``stopped``, the present stop, is news."""
        confirmed = stopped is not None and (stopped.confirmed or self._shown[1])
        before, self._shown = self._shown, (stopped is not None, confirmed)
        if self._shown != before:
            for listener in tuple(self.listeners):
                listener()
