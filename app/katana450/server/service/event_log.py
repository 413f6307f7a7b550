"""Event log with times of day: findings of the arm and the commands that caused them."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from katana450.arm.control.actor import Actor, CommandChannel
from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.messages import finding_text
from katana450.arm.control.state import Reason
from katana450.arm.runtime.state_publisher import MAX_KEPT_ENTRIES

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
    Reason.SLIPPED: "N",
    Reason.NOT_AT_START: "rad",
}
"""Units of the amounts; the other reasons have no amount."""


@dataclass(frozen=True)
class LogLine:
    """An entry of the event log with its time of day in UTC, ``when``."""

    entry: LogEntry
    when: datetime

    @property
    def who(self) -> str | None:
        """Name of the participant that gave the command; None for the server itself."""
        actor = self.entry.actor
        return None if actor is None or actor.channel is CommandChannel.SERVER else actor.name


class EventLog:
    """The newest lines of the event log."""

    def __init__(self) -> None:
        self._lines: deque[LogLine] = deque(maxlen=MAX_KEPT_ENTRIES)
        self._seen: LogEntry | None = None
        # Entries have times of the loop's monotonic clock.
        self._epoch = time.time() - time.perf_counter()

    def follow(
        self, event_log: Sequence[LogEntry], name: Callable[[Actor], Actor]
    ) -> list[LogEntry]:
        """Add the new entries of ``event_log``, with actors that have a ``name``; return them."""
        newer = [
            entry if entry.actor is None else replace(entry, actor=name(entry.actor))
            for entry in _newer(event_log, self._seen)
        ]
        for entry in newer:
            when = datetime.fromtimestamp(self._epoch + entry.t, UTC)
            self._lines.append(LogLine(entry, when))
            if entry.began:
                log.info("%s%s", _credit(entry), finding_text(entry.finding))
        if event_log:
            self._seen = event_log[-1]
        return newer

    @property
    def lines(self) -> tuple[LogLine, ...]:
        """All lines, the oldest first."""
        return tuple(self._lines)


def _credit(entry: LogEntry) -> str:
    """Return participant, channel, grounds and command, as the beginning of a log line."""
    actor = entry.actor
    if actor is None or actor.grounds is None:
        return ""
    return f"{actor.name} ({actor.channel.value}, {actor.grounds.value}), {entry.command}: "


def _newer(event_log: Sequence[LogEntry], last: LogEntry | None) -> list[LogEntry]:
    newer: list[LogEntry] = []
    for entry in reversed(event_log):
        if entry is last:
            break
        newer.append(entry)
    return newer[::-1]
