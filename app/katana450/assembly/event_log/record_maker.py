"""Records of the event log, made from notes: JSON objects of bounded size and without secrets.

Who did what, on what grounds, with what outcome. Commands that come in streams make one record, of
the first. Of the records that one participant can cause, more than a limit are counted, so that
nobody can quickly fill the log, or displace older records by new ones.
"""

from __future__ import annotations

import math
import time
from datetime import UTC, datetime
from typing import Any

import msgspec
import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import Act, Command, content_names
from katana450.arm.control.lease import SERVER, Actor, CommandChannel
from katana450.arm.control.state.findings import LogEntry
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.state import State
from katana450.maths.planning.plan import Plan
from katana450.server.service.limits import SenderBuckets, TokenBucket
from katana450.server.service.recorder import Note

Record = dict[str, Any]
"""A record: ``time``, ``t`` and ``kind``, and those of ``who``, ``what``, ``grounds``, ``outcome``
and ``why`` that are known."""

MAX_TEXT = 200
"""Maximum length of a text in a record, in characters."""

STREAM_GAP = 1.0
"""[s] Time without another command after which a stream has ended."""

MAX_STREAM_SECONDS = 60.0
"""[s] Duration after which a long stream gets another record."""

SUBJECT = ("axis", "name", "trait")
"""Attributes by which commands of one class belong to different streams."""

StreamKey = tuple[str, str, str, object]

SUMMARY_INTERVAL = 10.0
"""[s] Time between two summaries of what was not written."""

MAX_SENDERS = 512
"""Maximum number of participants whose records are counted, for each kind."""

RATE, BURST = 0.5, 100.0
"""Records of one participant per second [1/s], and in a burst, of each kind. A flood of one kind
leaves the others as they are."""

EVERYBODY_FACTOR = 4.0
"""Limits of all participants together, in limits of one."""

MAX_ITEMS = 16
"""Maximum number of items of a list or of fields in a record; a pose has 16 numbers."""

MAX_DEPTH = 3
"""Maximum depth of values in values; what is deeper is left out."""

SECRETS = frozenset({"token", "key", "cookie", "authorization"})
"""Names of fields whose values are never recorded."""


class RecordMaker:
    """Makes records of notes. For one thread."""

    def __init__(self) -> None:
        self._streams: dict[StreamKey, tuple[float, float]] = {}
        self._limits = RecordLimits()
        self._made: list[Record] = []
        self._stopped = False
        self._epoch = 0.0

    def made(self, notes: list[Note], t: float, *, closing: bool = False) -> list[Record]:
        """Return the records of ``notes``, and those that are due at ``t`` [s].

        ``closing``: no note will follow.
        """
        # Anew each time: the clock of the day may have been set.
        self._epoch = time.time() - time.perf_counter()
        for note in notes:
            self._take(note)
        spans = self._streams.items()
        self._streams = {key: span for key, span in spans if t - span[1] <= STREAM_GAP}
        if (summary := self._limits.summary(t, at_once=closing)) is not None:
            self._made.append({"time": utc(self._epoch + t), **summary})
        records, self._made = self._made, []
        return records

    @property
    def is_idle(self) -> bool:
        """True if no record will become due without another note."""
        return not self._limits.unwritten

    def _take(self, note: Note) -> None:
        match note.what:
            case Command() if note.kind == "command":
                self._command(note, note.what)
            case LogEntry():
                self._finding(note.what)
            case _:
                if note.kind in ("lease", "stop", "leave"):
                    self._streams.clear()
                self._stopped |= note.kind == "stop"
                self._add(note, content_of(note.what))

    def _command(self, note: Note, command: Command) -> None:
        key = _stream_key(note, command)
        if key is None:
            self._streams.clear()
            if isinstance(command, cmd.ClearStop):
                note = note._replace(kind="clear", always=self._stopped)
                self._stopped = False
            self._add(note, content_of(command))
            return
        first, last = self._streams.get(key, (-math.inf, -math.inf))
        if note.t - last > STREAM_GAP or note.t - first > MAX_STREAM_SECONDS:
            first = note.t
            self._add(note, content_of(command))
        self._streams[key] = first, note.t
        if isinstance(command, cmd.Jog) and not command.rates.any():
            del self._streams[key]

    def _finding(self, entry: LogEntry) -> None:
        finding = entry.finding
        what = {
            "finding": text(finding_text(finding)),
            "reason": finding.reason.value,
            "began": entry.began,
            "amount": content_of(finding.amount),
        }
        self._add(Note(entry.t, "finding"), what)

    def _add(self, note: Note, what: Any) -> None:
        """Add the record of ``note``, unless its participant causes too many."""
        record: Record = {
            "time": utc(self._epoch + note.t),
            "t": round(note.t, 3),
            "kind": note.kind,
            "who": _who(note.actor),
        }
        actor, grounds = note.actor, note.grounds
        if actor is not None and actor.grounds is not None:
            grounds = actor.grounds.value
        more = {"what": what, "grounds": grounds, "outcome": note.outcome, "why": text(note.why)}
        record |= {name: value for name, value in more.items() if value}
        if note.always or self._limits.admits(_source(note.actor), note.kind, note.t):
            self._made.append(record)


def _stream_key(note: Note, command: Command) -> StreamKey | None:
    """Return what the commands of one stream have in common; None for a single command.

    A slider, a held key or a dragged ring sends such commands many times a second.
    """
    for traits in (part.traits for part in command.parts):
        dragged = traits.stream or (traits.relative and traits.gesture)
        if not (dragged or traits.passive or not traits.while_paused):
            return None
    actor = note.actor or SERVER
    subject = tuple(
        (type(part), *(getattr(part, attribute, None) for attribute in SUBJECT))
        for part in command.parts
    )
    return actor.key, actor.channel.value, str(actor.grounds), subject


def _who(actor: Actor | None) -> dict[str, str]:
    """Return the public description of a participant: no key, cookie or token."""
    if actor is None:
        return {"name": "the arm", "channel": "arm"}
    if actor.channel is CommandChannel.SERVER:
        return {"name": actor.name, "channel": actor.channel.value}
    person = actor.person
    description = {
        "name": text(person.name),
        "role": person.role.value,
        "channel": actor.channel.value,
        "link": person.link,
        "address": text(person.address),
    }
    return {name: value for name, value in description.items() if value}


def _source(actor: Actor | None) -> str:
    """Return the participant to whose limits a record counts."""
    if actor is None:
        return ""
    return actor.person.link or actor.person.address or actor.name


class RecordLimits:
    """Limits by participant and kind, and for all participants by kind.

    Attributes:
        unwritten: number of records that were not written since the last summary.
    """

    def __init__(self) -> None:
        self.unwritten = 0
        self._kinds: dict[str, SenderBuckets] = {}
        self._since = 0.0

    def admits(self, source: str, kind: str, t: float) -> bool:
        """Return whether a record of ``source`` is written at ``t`` [s]; count it otherwise."""
        if kind not in self._kinds:
            total = TokenBucket(EVERYBODY_FACTOR * RATE, EVERYBODY_FACTOR * BURST, t)
            self._kinds[kind] = SenderBuckets(RATE, BURST, MAX_SENDERS, total)
        if self._kinds[kind].take(source, t):
            return True
        if not self.unwritten:
            self._since = t
        self.unwritten += 1
        return False

    def summary(self, t: float, *, at_once: bool = False) -> Record | None:
        """Return the record of what was not written up to ``t`` [s], and count from zero.

        None if nothing is due; ``at_once``: whether all is.
        """
        count, seconds = self.unwritten, t - self._since
        if not count or not (at_once or seconds >= SUMMARY_INTERVAL):
            return None
        self.unwritten = 0
        what = {"count": count, "seconds": round(seconds, 1)}
        return {"kind": "more", "what": what, "t": round(t, 3)}


def content_of(what: Any) -> Any:
    """Return ``what``, an act or another value, as a JSON value of bounded size."""
    if not isinstance(what, Act):
        return _bounded(_plain(what))
    if isinstance(what, cmd.Batch):
        parts = [content_of(part) for part in what.parts[:MAX_ITEMS]]
        return {"command": "Batch", "count": len(what.parts), "parts": parts}
    kind = "command" if isinstance(what, cmd.Command) else "request"
    fields = {name: _plain(getattr(what, name)) for name in content_names(type(what))}
    return {kind: type(what).__name__, **_bounded(fields)}


def _plain(value: Any) -> Any:
    """Return ``value`` made of the types of JSON; of a plan its duration, of a state its time."""
    match value:
        case Plan():
            return {"seconds": value.duration}
        case State():
            return {"t": value.t}
    return msgspec.to_builtins(value, enc_hook=_described, str_keys=True)


def _described(value: Any) -> Any:
    """Return what a record holds of a value that msgspec does not know."""
    match value:
        case np.generic():
            return value.item()
        case np.ndarray():
            # A mesh has thousands, which are not copied.
            few = value.size <= MAX_ITEMS
            return value.ravel().tolist() if few else f"{value.size} values"
    return type(value).__name__


def _bounded(value: Any, depth: int = 0) -> Any:
    """Return ``value`` of bounded size, without secrets. Numbers have six digits."""
    match value:
        case float():
            number = float(f"{value:.6g}")
            # JSON has no infinity.
            return number if abs(number) < float("inf") else str(value)
        case str():
            return text(value)
        case dict() | list() | tuple() if depth >= MAX_DEPTH:
            return "..."
        case dict():
            fields = [(text(name), entry) for name, entry in value.items() if name not in SECRETS]
            return {
                name: _bounded(entry, depth + 1)
                for name, entry in fields[:MAX_ITEMS]
                if entry is not None
            }
        case list() | tuple() if len(value) > MAX_ITEMS:
            return f"{len(value)} values"
        case list() | tuple():
            return [_bounded(entry, depth + 1) for entry in value]
    return value


def utc(seconds: float) -> str:
    """Return ``seconds`` since the epoch as ISO time in UTC with milliseconds."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")[:-6] + "Z"


def text(value: object) -> str:
    """Return ``value`` as a text of at most ``MAX_TEXT`` characters."""
    words = str(value)
    return words if len(words) <= MAX_TEXT else f"{words[:MAX_TEXT]}... ({len(words)} characters)"


def record(kind: str, what: Any = None, **more: Any) -> Record:
    """Return a record of the present time. ``more``: further fields."""
    content: Record = {"time": utc(time.time()), "t": round(time.perf_counter(), 3), "kind": kind}
    if what is not None:
        content["what"] = what
    return content | more
