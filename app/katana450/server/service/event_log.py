"""Why the arm did not reach its target, and whose command it was: for programs and the log."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from katana450.arm.control.actor import CommandChannel
from katana450.arm.control.event_log import Entry
from katana450.arm.control.messages import told
from katana450.arm.control.state import Reason
from katana450.arm.runtime.state_publisher import KEPT

log = logging.getLogger(__name__)

UNITS = {
    Reason.STOPPED: "m",
    Reason.CONTACT: "m",
    Reason.ACROSS_GAP: "rad",
    Reason.OUT_OF_REACH: "m",
    Reason.POSITION_CHANGED: "m",
    Reason.AXIS_LIMIT: "rad",
    Reason.SLIDE_LIMIT: "m",
    Reason.GRIPPER_LIMIT: "rad",
    Reason.GRIPPER_SLIDE_LIMIT: "m",
    Reason.YAW_FIXED: "rad",
    Reason.PITCH_CHANGED: "rad",
    Reason.ROLL_CHANGED: "rad",
    Reason.LOPSIDED: "m",
    Reason.NOT_AT_START: "rad",
}
"""Of the amounts; the other reasons have none."""


@dataclass(frozen=True)
class Line:
    """An entry of the ledger. when: in UTC."""

    entry: Entry
    when: datetime

    @property
    def who(self) -> str | None:
        """Name of the participant whose command it was; None where the server acted itself."""
        actor = self.entry.actor
        return None if actor is None or actor.channel is CommandChannel.SERVER else actor.name


class Journal:
    """The newest lines."""

    def __init__(self) -> None:
        self._lines: deque[Line] = deque(maxlen=KEPT)
        self._seen: Entry | None = None
        # Entries are on the loop's clock; people have another.
        self._epoch = time.time() - time.perf_counter()

    def follow(self, ledger: Sequence[Entry]) -> None:
        """Take down what ``ledger`` has that it had not before."""
        for entry in _newer(ledger, self._seen):
            when = datetime.fromtimestamp(self._epoch + entry.t, UTC)
            self._lines.append(Line(entry, when))
            if entry.began:
                log.info("%s%s", _credit(entry), told(entry.finding))
        if ledger:
            self._seen = ledger[-1]

    @property
    def lines(self) -> tuple[Line, ...]:
        """The oldest first."""
        return tuple(self._lines)


def _credit(entry: Entry) -> str:
    """Return who did what on what grounds, as the beginning of a log line."""
    actor = entry.actor
    if actor is None or actor.grounds is None:
        return ""
    return f"{actor.name} ({actor.channel.value}, {actor.grounds.value}), {entry.command}: "


def _newer(ledger: Sequence[Entry], seen: Entry | None) -> list[Entry]:
    newer: list[Entry] = []
    for entry in reversed(ledger):
        if entry is seen:
            break
        newer.append(entry)
    return newer[::-1]
