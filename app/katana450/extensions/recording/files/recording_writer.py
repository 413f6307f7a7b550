"""Writer of recordings: MCAP files with JSON messages.

A message is on the disk after ``flush`` and ``os.fsync`` of the file, which the caller does about
once a second. What was synced before a crash can be recovered.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from katana450.arm.control.state import State
from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.codec import Codec, json_text
from katana450.extensions.recording.digest import Digester
from katana450.extensions.recording.episodes.episode import EpisodeMessage
from katana450.extensions.recording.files.header import RecordingHeader
from katana450.extensions.recording.files.message_writer import MessageWriter
from katana450.extensions.recording.files.script_runs import (
    PROGRAM,
    ProgramEvent,
    attached_script,
    sha256,
)
from katana450.extensions.recording.forms import FormError
from katana450.extensions.recording.messages import (
    CHECKPOINTS,
    COMMANDS,
    EPISODES,
    EVENTS,
    JOINT_STATES,
    SHARED_TOPICS,
    STATE,
    TF,
    CheckpointMessage,
    TickMessage,
)
from katana450.extensions.recording.pseudonyms import Pseudonyms
from katana450.extensions.recording.state_message import StateMessages, nanoseconds
from katana450.extensions.recording.ticks import tick_message

CHECKPOINT_PERIOD = 10.0
"""[s] Time between two complete states: a simulation from one to any moment takes a second."""

SHOWN_PERIOD = 0.125
"""[s] Minimum time between two messages that only displays read."""


@dataclass
class _Written:
    """Part of the states that has been written so far."""

    content: bytes = b""
    t: float | None = None
    checkpoint_t: float | None = None
    shown_t: float = float("-inf")
    shown: bool = True
    moved: set[str] = field(default_factory=set)


class RecordingWriter:
    """Writes the ticks of one session to a file. For use in one thread.

    Every method may raise OSError. The file is then good for ``recover`` only.
    """

    def __init__(self, file: BinaryIO, header: RecordingHeader) -> None:
        """Begin a recording in ``file``, which is open for writing and empty."""
        self._writer = MessageWriter(file, header.metadata, header.attachments)
        self._codec, self._digester = Codec(), Digester()
        self._pseudonyms = Pseudonyms(header.salt)
        self._messages = StateMessages(header.robot, header.environment)
        self._number = 0
        self._written = _Written()
        self._scripts: set[tuple[str, float, bool]] = set()
        file.flush()

    def prepare(self, records: Sequence[TickRecord]) -> None:
        """Do what takes less time for several ticks together. ``put`` must follow for each."""
        self._messages.prepare([each.state for each in records])

    def put(self, record: TickRecord) -> None:
        """Write one tick. Its records must come in the order of the ticks, without gaps.

        A tick with a value that has no form is written as missing, with the reason.
        """
        record, written = self._pseudonyms.record(record), self._written
        state, t = record.state, record.t
        self._number += 1
        try:
            content = self._digester.content(state)
            digest = self._digester.digest(state, content)
            form = tick_message(self._codec, record, written.t, digest)
        except FormError as error:
            written.checkpoint_t = written.t = None
            self._add(COMMANDS, t, TickMessage(t, missing=str(error)))
            return
        self._add_shared(t)
        self._add(COMMANDS, t, form)
        written.t = state.t
        due = written.checkpoint_t is None or t - written.checkpoint_t >= CHECKPOINT_PERIOD
        if due:
            self._messages.describe_all()
        if due or content != written.content:
            written.content = content
            self._add_state(t, state)
        if not written.shown and t - written.shown_t >= SHOWN_PERIOD:
            self._add_shown(t, state)
        if due:
            self._add_checkpoint(t, state)

    def lost(self, t: float, ticks: int, why: str) -> None:
        """Record that ``ticks`` ticks until ``t`` [s] were lost, for the reason ``why``."""
        self._number += ticks
        self._written.checkpoint_t = self._written.t = None
        self._add(COMMANDS, t, TickMessage(t, missing=why, ticks=ticks))

    def event(self, t: float, kind: str, what: Mapping[str, Any]) -> None:
        """Record an event at ``t`` [s] with further fields, which are JSON values."""
        self._add(EVENTS, t, {"t": t, "kind": kind, **what})

    def script(self, t: float, name: str, text: str, since: float, *, began: bool) -> None:
        """Record at ``t`` [s] that a script began or ended, and attach its text once.

        ``since``: the time at which it began [s], maybe before the file.
        """
        script = attached_script(name, text, since)
        if (script.name, since, began) not in self._scripts:
            self._scripts.add((script.name, since, began))
            self._writer.attach(script)
            digest = sha256(script.data)
            event = ProgramEvent(t, PROGRAM, began, name, script.name, digest, since)
            self._add(EVENTS, t, event)

    def episode(self, t: float, message: EpisodeMessage) -> None:
        """Record the description of an episode at ``t`` [s]; see ``episodes.episode``."""
        self._add(EPISODES, t, message)

    def flush(self) -> None:
        """Give everything to the system. ``os.fsync`` of the file then brings it to the disk."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index and the end of the file. The file itself stays open."""
        self._writer.finish()

    def _add(self, topic: str, t: float, form: Any) -> None:
        self._writer.add(topic, self._number, max(nanoseconds(t), 0), json_text(form))

    def _add_shared(self, t: float) -> None:
        at = max(nanoseconds(t), 0)
        for kind, key, text in self._codec.shared.take_new():
            # The key is that of these bytes, so they are written as they are.
            data = b'{"key":"%b","value":%b}' % (key.encode(), text)
            self._writer.add(SHARED_TOPICS[kind], self._number, at, data)

    def _add_state(self, t: float, state: State) -> None:
        message = self._messages.state(state)
        self._add(STATE, t, message)
        self._written.shown = False
        self._written.moved.update(pose.name for pose in message.objects)
        self._written.moved.difference_update(message.removed)

    def _add_shown(self, t: float, state: State) -> None:
        """Write the messages that displays read."""
        self._add(JOINT_STATES, t, self._messages.joint_states(state))
        self._add(TF, t, self._messages.transforms(state, sorted(self._written.moved)))
        self._written.shown, self._written.shown_t = True, t
        self._written.moved.clear()

    def _add_checkpoint(self, t: float, state: State) -> None:
        try:
            form = self._codec.encoded(state)
        except FormError:
            # A value without a form, whose tick was written as missing. A later state may do.
            return
        self._add_shared(t)
        self._add(CHECKPOINTS, t, CheckpointMessage(t, form))
        self._written.checkpoint_t = t
