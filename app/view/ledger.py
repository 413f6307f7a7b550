"""The ledger in the panel and in the log: what held the arm back, when, by how much, what to do."""

from __future__ import annotations

import logging
import time
from html import escape

import viser

from app.control.ledger import Entry
from app.view.texts import REASONS

log = logging.getLogger(__name__)

SHOWN = 12
"""Entries in the panel; the log has all."""


class LedgerList:
    """Newest first."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._told: Entry | None = None
        # Entries are on the loop's clock; people have another.
        self._epoch = time.time() - time.perf_counter()
        self._list = gui.add_html(_page([]))

    def follow(self, ledger: tuple[Entry, ...]) -> None:
        """Show what has come since."""
        if not ledger or ledger[-1] is self._told:
            return
        since = ledger.index(self._told) + 1 if self._told in ledger else 0
        for entry in ledger[since:]:
            if entry.began:
                log.info("%s", _said(entry))
        self._told = ledger[-1]
        came = [entry for entry in ledger if entry.began][-SHOWN:]
        self._list.content = _page([(self._clock(entry), _said(entry)) for entry in reversed(came)])

    def _clock(self, entry: Entry) -> str:
        return time.strftime("%H:%M:%S", time.localtime(self._epoch + entry.t))


def _said(entry: Entry) -> str:
    said = REASONS[entry.finding.reason](entry.finding)
    return said[0].upper() + said[1:]


def _page(rows: list[tuple[str, str]]) -> str:
    if not rows:
        return "<div class='k450'><p class='empty'>Nothing has held the arm back yet.</p></div>"
    lines = "".join(f"<tr><td>{at}</td><th>{escape(said)}</th></tr>" for at, said in rows)
    return f"<div class='k450'><table class='ledger'><tbody>{lines}</tbody></table></div>"
