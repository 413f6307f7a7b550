"""The event log in the panel: what limited the arm, when, by how much, and what to do."""

from __future__ import annotations

import time
from html import escape

import viser

from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.messages import finding_text

MAX_SHOWN_ENTRIES = 12
"""Maximum number of entries in the panel. The log itself also has older ones and the driver."""


class EventList:
    """The newest entries of the event log, newest first."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._last: LogEntry | None = None
        # Entries have the time of the control loop's clock, not the time of day.
        self._epoch = time.time() - time.perf_counter()
        self._list = gui.add_html(_page([]))

    def follow(self, event_log: tuple[LogEntry, ...]) -> None:
        """Show the entries of ``event_log`` if there are new ones."""
        if not event_log or event_log[-1] is self._last:
            return
        self._last = event_log[-1]
        began = [entry for entry in event_log if entry.began][-MAX_SHOWN_ENTRIES:]
        rows = [(self._clock(entry), finding_text(entry.finding)) for entry in reversed(began)]
        self._list.content = _page(rows)

    def _clock(self, entry: LogEntry) -> str:
        return time.strftime("%H:%M:%S", time.localtime(self._epoch + entry.t))


def _page(rows: list[tuple[str, str]]) -> str:
    if not rows:
        return "<div class='k450'><p class='empty'>Nothing has limited the arm yet.</p></div>"
    lines = "".join(f"<tr><td>{at}</td><th>{escape(text)}</th></tr>" for at, text in rows)
    return f"<div class='k450'><table class='event_log'><tbody>{lines}</tbody></table></div>"
