"""The event log in the panel of a mechanism: what limited it, when, and by whose command."""

from __future__ import annotations

import time
from html import escape

import viser

from katana450.arm.control.actor import CommandChannel
from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.messages import finding_text
from katana450.server.view.controls import GestureGate
from katana450.server.view.scene_tab import problem_page

MAX_SHOWN_ENTRIES = 12
"""Maximum number of entries in the panel. The log itself also has older ones and the driver."""


class EventList:
    """The newest entries of the event log, newest first."""

    def __init__(self, gui: viser.GuiApi, gestures: GestureGate) -> None:
        self._gestures = gestures
        self._last: LogEntry | None = None
        self._problem = ""
        # Entries have the time of the control loop's clock, not the time of day.
        self._epoch = time.time() - time.perf_counter()
        self._list = gui.add_html(_page([], ""))

    @property
    def content(self) -> str:
        """The shown HTML."""
        return self._list.content

    def follow(self, event_log: tuple[LogEntry, ...]) -> None:
        """Show the entries of ``event_log`` if there are new ones, and a problem of the log."""
        problem, last = self._gestures.log_problem, event_log[-1] if event_log else None
        if last is self._last and problem == self._problem:
            return
        self._last, self._problem = last, problem
        began = [entry for entry in event_log if entry.began][-MAX_SHOWN_ENTRIES:]
        self._list.content = _page([self._row(entry) for entry in reversed(began)], problem)

    def _row(self, entry: LogEntry) -> str:
        cells = f"<td>{self._clock(entry)}</td><th>{escape(finding_text(entry.finding))}</th>"
        actor = entry.actor
        known = actor is not None and actor.channel is not CommandChannel.SERVER
        return f"<tr>{cells}<td>{escape(actor.name) if actor and known else ''}</td></tr>"

    def _clock(self, entry: LogEntry) -> str:
        return time.strftime("%H:%M:%S", time.localtime(self._epoch + entry.t))


def _page(rows: list[str], problem: str) -> str:
    found = f"<table class='event_log'><tbody>{''.join(rows)}</tbody></table>"
    shown = found if rows else "<p class='empty'>Nothing has limited the arm yet.</p>"
    return f"{problem_page(problem)}<div class='k450'>{shown}</div>"
