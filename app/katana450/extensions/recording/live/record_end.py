"""End of the pipe to the process that records, in the arm's process, and what goes through it.

The control thread only appends to a bounded list. A thread of its own serializes and sends, so that
neither a slow disk nor a process that hangs delays a tick. Most parts of a state are the same
Python objects as in the state before: the scene, the plan, the goal, the settings. Both ends
remember what was sent, so such a part goes as a reference, and remains one object at the other end
too.
"""

from __future__ import annotations

import io
import pickle
import threading
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import NamedTuple

from katana450.arm.runtime.pipes.guarded_pipe import PIPE_ERRORS, GuardedPipe
from katana450.arm.runtime.tick import TickRecord

MAX_REMEMBERED = 500
"""Number of records after which both ends forget what was sent. It bounds their memory."""

BEGIN, CONTINUATION = b"\x01", b"\x02"
"""First byte of a message: whether it refers to nothing, or to messages before it."""


class LostTicks(NamedTuple):
    """A number of ticks that were lost, until the time ``until`` [s]."""

    ticks: int
    until: float


Sent = list[TickRecord] | LostTicks


class RecordSerializer:
    """Serializer at the end of the arm."""

    def __init__(self) -> None:
        self._file = io.BytesIO()
        self._pickler = pickle.Pickler(self._file, pickle.HIGHEST_PROTOCOL)
        self._remembered = 0

    def dumped(self, records: Sent) -> bytes:
        """Return ``records`` as bytes, for the next message."""
        first = self._remembered == 0
        if first:
            self._pickler.clear_memo()
        self._remembered += 1 if isinstance(records, LostTicks) else len(records)
        if self._remembered >= MAX_REMEMBERED:
            self._remembered = 0
        self._file.seek(0)
        self._file.truncate()
        self._file.write(BEGIN if first else CONTINUATION)
        self._pickler.dump(records)
        return self._file.getvalue()


class RecordDeserializer:
    """Deserializer at the other end. Every message must be loaded, in the order of dumping."""

    def __init__(self) -> None:
        self._file = io.BytesIO()
        self._unpickler = pickle.Unpickler(self._file)

    def loaded(self, data: bytes) -> Sent:
        """Return the records in ``data``, or the number of those that were lost."""
        if data.startswith(BEGIN):
            self._file = io.BytesIO()
            self._unpickler = pickle.Unpickler(self._file)
        self._file.seek(0)
        self._file.truncate()
        self._file.write(data)
        self._file.seek(len(BEGIN))
        records: Sent = self._unpickler.load()
        return records


MAX_WAITING = 3000
"""Number of records that wait for a slow reader, 30 s of motion; the next ones are lost."""

BATCH = 20
"""Number of records in a message, 0.2 s of motion. It is sent after the tick of the last one, when
the control thread sleeps."""

COLLECTING = 0.25
"""[s] Maximum time for which a record waits for further ones. It is longer than a batch takes, so
that in motion ticks begin the sending, and not a clock that sends during a tick."""

JOIN_TIMEOUT = 1.0
"""[s] Time for the last records when the arm's process ends."""


class RecordEnd:
    """Sends the record of each tick, and the number of those that were lost.

    While no process receives them, records wait. So none is missing when that process starts later
    than the arm, or is started again.
    """

    def __init__(self) -> None:
        """Keep records until there is a pipe."""
        self._waiting: deque[TickRecord] = deque()
        self._lost, self._lost_until = 0, 0.0
        self._losing = threading.Lock()
        self._any, self._full = threading.Event(), threading.Event()
        self._closed = threading.Event()
        self._attaching = threading.Lock()
        self._pipe: Connection | None = None
        self._thread: threading.Thread | None = None

    def put(self, record: TickRecord) -> None:
        """Take ``record`` in the control thread."""
        if len(self._waiting) >= MAX_WAITING or self._lost:
            with self._losing:
                self._lost, self._lost_until = self._lost + 1, record.t
        else:
            self._waiting.append(record)
        if not self._any.is_set():
            self._any.set()
        if len(self._waiting) >= BATCH and not self._full.is_set():
            self._full.set()

    def attach(self, pipe: Connection, _greeting: object = None) -> None:
        """Send what waits, and all further records, by ``pipe`` in place of any previous one."""
        with self._attaching:
            before, self._pipe = self._pipe, pipe
            if before is not None:
                with suppress(OSError):
                    before.close()
                self._end()
            self._thread = threading.Thread(
                target=self._send, args=(pipe,), name="records out", daemon=True
            )
            self._thread.start()

    def close(self) -> None:
        """End after what waits, or after a short time."""
        self._closed.set()
        self._end()

    def _end(self) -> None:
        """Wait for the thread, which ends when its pipe is closed or nothing more comes."""
        self._full.set()
        self._any.set()
        if self._thread is not None:
            self._thread.join(JOIN_TIMEOUT)

    def _send(self, pipe: Connection) -> None:
        serializer = RecordSerializer()
        with GuardedPipe(pipe, "The pipe to the process that records"):
            while pipe is self._pipe and not (self._closed.is_set() and not self._waiting):
                self._full.wait(COLLECTING)
                self._full.clear()
                if not (self._waiting or self._lost):
                    self._wait_for_any(pipe)
                while self._waiting:
                    count = min(len(self._waiting), BATCH)
                    records = [self._waiting.popleft() for _ in range(count)]
                    try:
                        pipe.send_bytes(serializer.dumped(records))
                    except PIPE_ERRORS:
                        # They go by the next pipe. After another error they would end that too.
                        self._waiting.extendleft(reversed(records))
                        raise
                if self._lost:
                    self._report_lost(pipe, serializer)
        with suppress(OSError):
            pipe.close()

    def _wait_for_any(self, pipe: Connection) -> None:
        """Wait until the arm moves, or until there is no more to wait for."""
        self._any.clear()
        # What came before the flag was cleared has not set it.
        ended = self._closed.is_set() or pipe is not self._pipe
        if not (self._waiting or self._lost or ended):
            self._any.wait()

    def _report_lost(self, pipe: Connection, serializer: RecordSerializer) -> None:
        """Send the number of lost records. Until it is 0, the control thread adds no record."""
        with self._losing:
            lost, until, self._lost = self._lost, self._lost_until, 0
        # A record that was added since then is sent later, in this thread.
        try:
            pipe.send_bytes(serializer.dumped(LostTicks(lost, until)))
        except OSError:
            # To be reported by the next pipe.
            with self._losing:
                self._lost += lost
            raise
