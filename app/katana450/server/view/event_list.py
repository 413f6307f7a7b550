"""The event log in the panel: what held the arm back, when, by how much, what to do."""

from __future__ import annotations

import time
from html import escape

import viser

from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.messages import finding_text

MAX_SHOWN_ENTRIES = 12
"""Entries in the panel; the log has all, and who drove."""


class LedgerList:
    """Newest first."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._told: LogEntry | None = None
        # Entries are on the loop's clock; people have another.
        self._epoch = time.time() - time.perf_counter()
        self._list = gui.add_html(_page([]))

    def follow(self, event_log: tuple[LogEntry, ...]) -> None:
        """Show what has come since."""
        if not event_log or event_log[-1] is self._told:
            return
        self._told = event_log[-1]
        came = [entry for entry in event_log if entry.began][-MAX_SHOWN_ENTRIES:]
        rows = [(self._clock(entry), finding_text(entry.finding)) for entry in reversed(came)]
        self._list.content = _page(rows)

    def _clock(self, entry: LogEntry) -> str:
        return time.strftime("%H:%M:%S", time.localtime(self._epoch + entry.t))


def _page(rows: list[tuple[str, str]]) -> str:
    if not rows:
        return "<div class='k450'><p class='empty'>Nothing has held the arm back yet.</p></div>"
    lines = "".join(f"<tr><td>{at}</td><th>{escape(said)}</th></tr>" for at, said in rows)
    return f"<div class='k450'><table class='event_log'><tbody>{lines}</tbody></table></div>"
