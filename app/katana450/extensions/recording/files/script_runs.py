"""Runs of scripts in recordings: their events, and the texts of the scripts as attachments.

Each file that has a text also has an event of each of its runs, which may have begun before the
file. So a part of a recording has exactly the scripts that ran in it.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import msgspec

from katana450.extensions.recording.files.header import Attachment
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.messages import EVENTS, nanoseconds

FOLDER: Final = "scripts/"
"""Start of the names of attached scripts."""

MEDIA_TYPE: Final = "application/yaml"

PROGRAM: Final = "program"
"""Kind of the events of the begin and the end of a run."""

UNUSUAL = re.compile(r"[^A-Za-z0-9_-]+")
MAX_NAME = 40

HASH_DIGITS = 12
"""Number of digits of the hash in the name of an attached script."""


def attached_script(name: str, text: str, began: float) -> Attachment:
    """Return the script ``name`` with its ``text``, which ran at ``began`` [s] first."""
    data = text.encode("utf-8", "replace")
    plain = UNUSUAL.sub("-", name).strip("-")[:MAX_NAME] or "script"
    named = f"{FOLDER}{plain}-{sha256(data)[:HASH_DIGITS]}.yaml"
    return Attachment(named, MEDIA_TYPE, data, max(nanoseconds(began), 0))


def sha256(data: bytes) -> str:
    """Return the SHA-256 of ``data`` in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


class ProgramEvent(msgspec.Struct):
    """Event of the begin or the end of a run.

    Attributes:
        t: time of the event [s].
        kind: PROGRAM.
        began: whether the run began.
        name: name of the script.
        script: name of the attachment with its text.
        sha256: SHA-256 of its text.
        since: begin of the run [s].
    """

    t: float
    kind: str
    began: bool
    name: str
    script: str
    sha256: str
    since: float


@dataclass(frozen=True)
class ScriptRun:
    """A run of a script.

    Attributes:
        name: name of the script.
        script: name of the attachment with its text.
        sha256: SHA-256 of its text.
        start: time at which it began [s].
        end: time at which it ended [s]; None if it had not ended.
    """

    name: str
    script: str
    sha256: str
    start: float
    end: float | None = None

    def overlaps(self, start: float, end: float) -> bool:
        """Return whether it ran at any time from ``start`` to ``end`` [s]."""
        return self.start <= end and (self.end is None or self.end >= start)


def script_runs(files: Iterable[RecordingFile]) -> list[ScriptRun]:
    """Return the runs in ``files`` of one run of the server, by their begin. Raises InputError."""
    by_begin: dict[tuple[str, float], ScriptRun] = {}
    for file in files:
        for message in file.messages(EVENTS):
            event = program_event_in(message)
            if event is None:
                continue
            key = event.script, event.since
            end = None if event.began else event.t
            known = by_begin.get(key)
            if known is not None and end is None:
                end = known.end
            by_begin[key] = ScriptRun(event.name, event.script, event.sha256, event.since, end)
    return sorted(by_begin.values(), key=lambda run: run.start)


def program_event_in(message: Message) -> ProgramEvent | None:
    """Return the event in ``message``; None for another one."""
    if b'"kind":"program"' not in message.data:
        return None
    try:
        return msgspec.json.decode(message.data, type=ProgramEvent)
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return None


def begun_before(run: ScriptRun, t: float) -> bytes:
    """Return the message at ``t`` [s] about ``run``, which had begun before."""
    event = ProgramEvent(t, PROGRAM, True, run.name, run.script, run.sha256, run.start)
    return msgspec.json.encode(event)


def scripts_in(
    files: Sequence[RecordingFile], start: float, end: float
) -> tuple[list[Attachment], list[ScriptRun]]:
    """Return the attachments of the part of ``files`` from ``start`` to ``end`` [s].

    All but the scripts that ran at other times only; and the runs in the part. Raises InputError.
    """
    runs = script_runs(files)
    known, present = {run.script for run in runs}, [run for run in runs if run.overlaps(start, end)]
    needed = {run.script for run in present}
    attachments: dict[str, Attachment] = {}
    for file in files:
        for attachment in file.attachments():
            if attachment.name not in known or attachment.name in needed:
                attachments.setdefault(attachment.name, attachment)
    return list(attachments.values()), present
