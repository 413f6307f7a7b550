"""Records of the event log, made from notes: who did what, on what grounds, with what outcome.

Commands that come in streams make one record at the start and one at the end.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

from katana450.arm.control import commands as cmd
from katana450.arm.control.act import Command
from katana450.arm.control.actor import SERVER, Actor, CommandChannel
from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.messages import finding_text
from katana450.arm.control.outcome import reason
from katana450.arm.control.state import Outcome, Verdict
from katana450.extensions.event_log.record_limits import RecordLimits
from katana450.extensions.event_log.records import Record, content_of, text, utc
from katana450.server.service.recorder import LeaseChange, Note

STREAM_GAP = 1.0
"""[s] Time without another command after which a stream has ended."""

MAX_STREAM_SECONDS = 60.0
"""[s] Duration after which a long stream gets a record, and continues as a new one."""

MAX_TICKETS = 1024
"""Maximum number of commands whose outcome is awaited."""


@dataclass
class CommandStream:
    """Commands of one kind from one participant, in quick succession."""

    first: Note
    last: Note
    count: int = 1

    def add(self, note: Note) -> None:
        """Add the next command."""
        self.last = note
        self.count += 1


SUBJECT = ("axis", "name", "trait")
"""Attributes by which commands of one class belong to different streams."""

StreamKey = tuple[str, str, str, object]


class RecordMaker:
    """Makes records of notes. For one thread."""

    def __init__(self) -> None:
        self._streams: dict[StreamKey, CommandStream] = {}
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
        ended = [
            key
            for key, stream in self._streams.items()
            if closing or t - stream.last.t > STREAM_GAP
        ]
        for key in ended:
            self._end(key)
        for summary in self._limits.summaries(t, all_now=closing):
            self._made.append({"time": utc(self._epoch + t), **summary})
        records, self._made = self._made, []
        return records

    @property
    def is_idle(self) -> bool:
        """True if no record will become due without another note."""
        return not (self._streams or self._outcomes or self._limits.counts)

    def _take(self, note: Note) -> None:
        match note.what:
            case Command() if note.kind == "command":
                self._command(note, note.what)
            case Outcome():
                self._outcomes.append(note)
            case LogEntry():
                self._finding(note.what)
            case LeaseChange():
                self._lease(note, note.what)
            case _:
                if note.kind in ("stop", "leave"):
                    self._end_all()
                self._stopped |= note.kind == "stop"
                self._add(note, content_of(note.what))

    def _command(self, note: Note, command: Command) -> None:
        if note.ticket:
            self._commands[note.ticket] = note
            if len(self._commands) > MAX_TICKETS:
                self._commands.popitem(last=False)
        key = _stream_key(note, command)
        if key is None:
            self._end_all()
            if isinstance(command, cmd.ClearStop):
                note = note._replace(kind="clear", always=self._stopped)
                self._stopped = False
            self._add(note, content_of(command))
            return
        stream = self._streams.get(key)
        if (
            stream is not None
            and note.t - stream.last.t <= STREAM_GAP
            and note.t - stream.first.t <= MAX_STREAM_SECONDS
        ):
            stream.add(note)
        else:
            self._end(key)
            self._streams[key] = CommandStream(note, note)
            self._add(note, content_of(command))
        if isinstance(command, cmd.Jog) and not command.rates.any():
            self._end(key)

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
            "command": entry.command,
        }
        self._add(Note(entry.t, "finding", entry.actor), what)

    def _lease(self, note: Note, change: LeaseChange) -> None:
        before, after = change
        by = note.actor or SERVER
        requests = [person for person in after.waiting if person not in before.waiting]
        ended = [person for person in before.waiting if person not in after.waiting]
        old, new = before.holder, after.holder
        what: dict[str, Any]
        if new != old:
            self._end_all()
            what, grounds = _transfer(change, by)
            if old is not None:
                what["from"] = text(old.name)
            if new is not None:
                what["to"] = text(new.name)
        elif requests:
            what, grounds = {"lease": "requested", "from": old.name if old else None}, ""
        elif ended and by is not SERVER:
            withdrawn = ended[0] == by.person
            what = {"lease": "withdrawn" if withdrawn else "declined", "to": text(ended[0].name)}
            grounds = "" if withdrawn else "holds the lease"
        else:
            return
        self._add(note, what, grounds)

    def _end_all(self) -> None:
        for key in tuple(self._streams):
            self._end(key)

    def _end(self, key: StreamKey) -> None:
        """Record the end of a stream; a single command is no stream."""
        stream = self._streams.pop(key, None)
        if stream is None or stream.count == 1:
            return
        first, last = content_of(stream.first.what), content_of(stream.last.what)
        what = {
            "command": first.pop("command"),
            "count": stream.count,
            "seconds": round(stream.last.t - stream.first.t, 3),
            "first": first,
            "last": {name: value for name, value in last.items() if name != "command"},
        }
        self._add(stream.last._replace(kind="stream", outcome=""), what)

    def _add(self, note: Note, what: Any, grounds: str = "") -> None:
        """Add the record of ``note``, unless its participant causes too many."""
        record: Record = {
            "time": utc(self._epoch + note.t),
            "t": round(note.t, 3),
            "kind": note.kind,
            "who": _who(note.actor),
        }
        if note.ticket and isinstance(what, dict):
            what = {**what, "ticket": note.ticket}
        if note.actor is not None and note.actor.grounds is not None:
            grounds = note.actor.grounds.value
        more = {"what": what, "grounds": grounds, "outcome": note.outcome, "why": text(note.why)}
        record |= {name: value for name, value in more.items() if value}
        if note.always or self._limits.admits(_source(note.actor), record, note.t):
            self._made.append(record)


def _stream_key(note: Note, command: Command) -> StreamKey | None:
    """Return what the commands of one stream have in common; None for a single command.

    A slider or a held key sends such commands many times a second.
    """
    if not all(
        part.traits.stream or part.traits.passive or not part.traits.while_paused
        for part in command.parts
    ):
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


def _transfer(change: LeaseChange, by: Actor) -> tuple[dict[str, Any], str]:
    """Return the name of a change of holder, and its grounds."""
    new = change.after.holder
    if new is None:
        if by is SERVER:
            return {"lease": "expired"}, "the holder was silent"
        return {"lease": "released"}, "holds the lease"
    if change.before.driver is None:
        return {"lease": "acquired"}, "the lease was free"
    if new == by.person:
        return {"lease": "taken"}, "an admin may take the lease"
    return {"lease": "handed over"}, "holds the lease"
