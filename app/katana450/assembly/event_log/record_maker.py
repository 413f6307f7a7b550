"""Records of the event log, made from notes in a thread, and sent to the process that writes them.

Who did what, on what grounds, with what outcome. Commands that come in streams make one record, of
the first. Of the records that one participant can cause, more than a limit are counted, so that
nobody can quickly fill the log, or displace older records by new ones.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import Counter, OrderedDict
from contextlib import suppress
from multiprocessing.connection import Connection
from queue import Empty
from typing import Any

from katana450.arm.control.actor import SERVER, Actor, CommandChannel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import Command
from katana450.arm.control.session.outcome import reason
from katana450.arm.control.state.event_log import LogEntry
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.state import Outcome, Verdict
from katana450.arm.runtime.clock import MonotonicClock
from katana450.assembly.event_log.record_content import content_of
from katana450.assembly.event_log.records import Record, record, text, utc
from katana450.server.service.limits import SenderBuckets, TokenBucket
from katana450.server.service.recorder import Note, Recorder

STREAM_GAP = 1.0
"""[s] Time without another command after which a stream has ended."""

MAX_STREAM_SECONDS = 60.0
"""[s] Duration after which a long stream gets another record."""

MAX_TICKETS = 1024
"""Maximum number of commands whose outcome is awaited."""

SUBJECT = ("axis", "name", "trait")
"""Attributes by which commands of one class belong to different streams."""

LEASE_REQUESTS = ("requested", "withdrawn", "declined")
"""Words of the records about the lease that tell of no change of its holder."""

StreamKey = tuple[str, str, str, object]

SUMMARY_INTERVAL = 10.0
"""[s] Time between two summaries of what was not written."""

MAX_SENDERS = 512
"""Maximum number of participants whose records are counted, for each kind."""

SESSION = (60.0, 0.2)

LIMITS = {
    "stop": (30.0, 0.5),
    "clear": (30.0, 0.5),
    "lease": (60.0, 0.5),
    "finding": (200.0, 1.0),
    "outcome": (200.0, 1.0),
    "refusal": (20.0, 0.2),
    **dict.fromkeys(("join", "leave", "rename", "sign-in", "upload"), SESSION),
}
"""Records of one participant in a burst, and per second [1/s] afterwards, by kind. A flood of one
kind leaves the others as they are."""

COMMANDS = (600.0, 2.0)
"""The same for all other kinds."""

EVERYBODY_FACTOR = 4.0
"""Limits of all participants together, in limits of one."""

log = logging.getLogger(__name__)

COLLECTING = 0.02
"""[s] Minimum time between two turns of the thread, so that a stream wakes it rarely."""

TURN = 0.25
"""[s] Maximum time between two turns while a summary is open."""

IDLE_TURN = 1.0
"""[s] Maximum time between two turns otherwise, after which a problem of the writer is known."""

CLOSE_TIMEOUT = 1.0
"""[s] Time for the last records at the end of the process."""


class RecordMaker:
    """Makes records of notes. For one thread."""

    def __init__(self) -> None:
        self._streams: dict[StreamKey, tuple[float, float]] = {}
        self._commands: OrderedDict[int, Note] = OrderedDict()
        self._outcomes: list[Note] = []
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
        # Their thread can be quicker than the one that gave the command, so they wait for a turn.
        outcomes, self._outcomes = self._outcomes, []
        for note in outcomes:
            self._outcome(note)
        for note in notes:
            self._take(note)
        for note in self._outcomes if closing else ():
            self._outcome(note)
        spans = self._streams.items()
        self._streams = {key: span for key, span in spans if t - span[1] <= STREAM_GAP}
        if (summary := self._limits.summary(t, at_once=closing)) is not None:
            self._made.append({"time": utc(self._epoch + t), **summary})
        records, self._made = self._made, []
        return records

    @property
    def is_idle(self) -> bool:
        """True if no record will become due without another note."""
        return not (self._outcomes or self._limits.unwritten)

    def _take(self, note: Note) -> None:
        match note.what:
            case Command() if note.kind == "command":
                self._command(note, note.what)
            case Outcome():
                self._outcomes.append(note)
            case LogEntry():
                self._finding(note.what)
            case _:
                transfer = note.kind == "lease" and note.what["lease"] not in LEASE_REQUESTS
                if transfer or note.kind in ("stop", "leave"):
                    self._streams.clear()
                self._stopped |= note.kind == "stop"
                self._add(note, content_of(note.what))

    def _command(self, note: Note, command: Command) -> None:
        if note.ticket:
            self._commands[note.ticket] = note
            if len(self._commands) > MAX_TICKETS:
                self._commands.popitem(last=False)
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

    def _outcome(self, note: Note) -> None:
        """Record that a command was limited or refused."""
        command, outcome = self._commands.pop(note.ticket, None), note.what
        if command is not None:
            limited = outcome.verdict is Verdict.LIMITED
            why = "; ".join(map(finding_text, outcome.findings)) if limited else reason(outcome)
            named = note._replace(actor=command.actor, outcome=outcome.verdict.value, why=why)
            self._add(named, {"command": type(command.what).__name__})

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
        if note.ticket and isinstance(what, dict):
            what = {**what, "ticket": note.ticket}
        actor, grounds = note.actor, note.grounds
        if actor is not None and actor.grounds is not None:
            grounds = actor.grounds.value
        more = {"what": what, "grounds": grounds, "outcome": note.outcome, "why": text(note.why)}
        record |= {name: value for name, value in more.items() if value}
        if note.always or self._limits.admits(_source(note.actor), record, note.t):
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
        unwritten: number of records that were not written since the last summary, by participant,
            kind and name.
    """

    def __init__(self) -> None:
        self.unwritten: Counter[str] = Counter()
        self._kinds: dict[str, SenderBuckets] = {}
        self._since = 0.0

    def admits(self, source: str, record: Record, t: float) -> bool:
        """Return whether ``record`` of ``source`` is written at ``t`` [s]; count it otherwise."""
        kind = record["kind"]
        if kind not in self._kinds:
            burst, rate = LIMITS.get(kind, COMMANDS)
            total = TokenBucket(EVERYBODY_FACTOR * rate, EVERYBODY_FACTOR * burst, t)
            self._kinds[kind] = SenderBuckets(rate, burst, MAX_SENDERS, total)
        if self._kinds[kind].take(source, t):
            return True
        if not self.unwritten:
            self._since = t
        self.unwritten[_label(record)] += 1
        return False

    def summary(self, t: float, *, at_once: bool = False) -> Record | None:
        """Return the record of what was not written up to ``t`` [s], and count from zero.

        None if nothing is due; ``at_once``: whether all is.
        """
        counts, seconds = self.unwritten, t - self._since
        if not counts or not (at_once or seconds >= SUMMARY_INTERVAL):
            return None
        self.unwritten = Counter()
        commonest = dict(counts.most_common(8))
        what = {"count": counts.total(), "seconds": round(seconds, 1), "of": commonest}
        return {"kind": "more", "what": what, "t": round(t, 3)}


def _label(record: Record) -> str:
    """Return participant and kind of ``record``, with the name of its command or request."""
    what = record.get("what")
    name = ""
    if isinstance(what, dict):
        name = what.get("command") or what.get("request") or what.get("lease") or ""
    return f"{record['who']['name']}: {record['kind']} {name}".strip()


class RecordSender:
    """Sends records of the notes of ``recorder`` to a ``LogWriter`` at the end of ``pipe``."""

    def __init__(self, recorder: Recorder, pipe: Connection) -> None:
        """Start the thread."""
        self._recorder = recorder
        self._pipe = pipe
        self._maker = RecordMaker()
        self._now = MonotonicClock().now
        recorder.enabled = True
        self._thread = threading.Thread(target=self._run, name="records", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Send the records of all notes, and end the thread."""
        self._recorder.enabled = False
        self._recorder.notes.put(None)
        self._thread.join(CLOSE_TIMEOUT)

    def _run(self) -> None:
        closing, waiting = False, self._recorder.notes
        try:
            while not closing:
                notes: list[Note | None] = []
                with suppress(Empty):
                    notes.append(waiting.get(timeout=IDLE_TURN if self._maker.is_idle else TURN))
                    while True:
                        notes.append(waiting.get_nowait())
                closing = None in notes
                records = self._made([note for note in notes if note is not None], closing=closing)
                if records:
                    self._pipe.send(records)
                while self._pipe.poll():
                    self._recorder.problem = str(self._pipe.recv())
                time.sleep(0.0 if closing else COLLECTING)
        except (EOFError, OSError):
            # The other process has ended, and this one will.
            self._recorder.enabled = False

    def _made(self, notes: list[Note], *, closing: bool) -> list[Record]:
        recorder, records = self._recorder, list[Record]()
        lost, recorder.lost = recorder.lost, 0
        try:
            records = self._maker.made(notes, self._now(), closing=closing)
        except Exception:
            log.exception("The recorder met an error; it continues with the next event.")
            lost += len(notes)
        if lost:
            records.append(record("lost", {"count": lost}, why="Too many events came at once."))
        return records
