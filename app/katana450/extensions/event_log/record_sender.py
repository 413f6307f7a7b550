"""Sender of records: a thread that makes them of the notes of this process."""

from __future__ import annotations

import logging
import threading
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from queue import Empty

from katana450.arm.runtime.clock import MonotonicClock
from katana450.extensions.event_log.record_maker import RecordMaker
from katana450.extensions.event_log.records import Record, record
from katana450.server.service.recorder import Note, Recorder

log = logging.getLogger(__name__)

COLLECTING = 0.02
"""[s] Minimum time between two turns of the thread, so that a stream wakes it rarely."""

TURN = 0.25
"""[s] Maximum time between two turns while a stream or a summary is open."""

IDLE_TURN = 1.0
"""[s] Maximum time between two turns otherwise, after which a problem of the writer is known."""

CLOSE_TIMEOUT = 1.0
"""[s] Time for the last records at the end of the process."""


def send_records(
    options: Namespace, recorder: Recorder, pipe: Connection
) -> Callable[[], None] | None:
    """Send records of the notes of ``recorder`` by ``pipe``; return the function that ends this.

    None if the options choose no event log.
    """
    return None if options.no_log else RecordSender(recorder, pipe).close


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
