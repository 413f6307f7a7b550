"""End of the pipe to the process that records, in the arm's process.

The control thread only appends to a bounded list. A thread of its own serializes and sends, so that
neither a slow disk nor a process that hangs delays a tick.
"""

from __future__ import annotations

import threading
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection

from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.live.record_wire import RecordSerializer

MAX_WAITING = 3000
"""Number of records that wait for a slow reader, 30 s of motion; the next ones are lost."""

COLLECTING = 0.1
"""[s] Minimum time between two turns of the thread, so that ticks wake it rarely."""

JOIN_TIMEOUT = 1.0
"""[s] Time for the last records when the arm's process ends."""


class RecordEnd:
    """Sends the record of each tick of a control loop, and the number of those that were lost."""

    def __init__(self, pipe: Connection, loop: ControlLoop) -> None:
        """Create the end; ``start`` runs it."""
        self._pipe = pipe
        self._loop = loop
        self._waiting: deque[TickRecord] = deque()
        self._lost = 0
        self._lost_until = 0.0
        self._losing = threading.Lock()
        self._any = threading.Event()
        self._cut = threading.Event()
        self._thread = threading.Thread(target=self._send, name="records out", daemon=True)

    def start(self) -> None:
        """Send the records of all further ticks, in a thread of its own, until the pipe is cut."""
        self._loop.record = self.put
        self._thread.start()

    def close(self) -> None:
        """End the records after those that wait."""
        if self._loop.record == self.put:
            self._loop.record = None
        self._cut.set()
        self._any.set()

    def join(self) -> None:
        """Wait until the records that waited are sent, or for a short time."""
        self._thread.join(JOIN_TIMEOUT)

    def put(self, record: TickRecord) -> None:
        """Take ``record`` in the control thread."""
        if len(self._waiting) >= MAX_WAITING or self._lost:
            with self._losing:
                self._lost, self._lost_until = self._lost + 1, record.t
        else:
            self._waiting.append(record)
        if not self._any.is_set():
            self._any.set()

    def _send(self) -> None:
        serializer = RecordSerializer()
        with suppress(EOFError, OSError):
            while not (self._cut.is_set() and not self._waiting):
                self._any.wait()
                self._any.clear()
                while self._waiting:
                    self._pipe.send_bytes(serializer.dumped(self._waiting.popleft()))
                if self._lost:
                    self._report_lost()
                self._cut.wait(COLLECTING)
        if self._loop.record == self.put:
            self._loop.record = None
        with suppress(OSError):
            self._pipe.close()

    def _report_lost(self) -> None:
        """Send the number of lost records. Until it is 0, the control thread adds no record."""
        with self._losing:
            lost, until, self._lost = self._lost, self._lost_until, 0
        # A record that was added since then is sent later, in this thread.
        self._pipe.send_bytes(lost_message(lost, until))


def lost_message(count: int, until: float) -> bytes:
    """Return the message that ``count`` records until the time ``until`` [s] were lost."""
    return f"{LOST.decode()}{count} {until!r}".encode()


LOST = b"lost "
"""Begin of the message about lost records; those of records begin with that of a pickle."""


def lost_records(message: bytes) -> tuple[int, float] | None:
    """Return how many records were lost, and until which time [s]; None for another message."""
    if not message.startswith(LOST):
        return None
    count, until = message[len(LOST) :].split()
    return int(count), float(until)
