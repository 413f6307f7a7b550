"""End of the pipe to the process of STOP, in the arm's process."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from multiprocessing.connection import Connection

from katana450.arm.control.commands import commands as cmd
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.pipes.arm_end import JOIN_TIMEOUT
from katana450.arm.runtime.pipes.guarded_pipe import GuardedPipe
from katana450.arm.runtime.pipes.stop_messages import STATUS_INTERVAL, StopPress, StopStatus
from katana450.platform_support import prefer_thread

PIPE = "The pipe to the process of STOP"


class StopEnd:
    """Puts each STOP from the pipe into the mailbox, and reports whether the arm is stopped.

    The arm does not stop when this pipe is cut: the front end is the other path of STOP.
    """

    def __init__(self, pipe: Connection, loop: ControlLoop, mailbox: Mailbox) -> None:
        """Create the end of ``pipe``; ``start`` runs it. ``mailbox``: that of ``loop``."""
        self._pipe = pipe
        self._loop = loop
        self._mailbox = mailbox
        self._cut = threading.Event()
        self._threads = [
            threading.Thread(target=target, name=f"stop {name}", daemon=True)
            for name, target in (("in", self._listen), ("out", self._report))
        ]

    def start(self) -> None:
        """Run the end in threads of its own until the pipe is cut."""
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End the reports."""
        self._cut.set()

    def join(self) -> None:
        """Wait for the threads; they end when both ends of the pipe are closed."""
        for thread in self._threads:
            thread.join(JOIN_TIMEOUT)
        with suppress(OSError):
            self._pipe.close()

    def _listen(self) -> None:
        prefer_thread()
        with GuardedPipe(self._pipe, PIPE):
            while not self._cut.is_set():
                # A press wakes this thread at once; the end of the arm's process does later.
                if not self._pipe.poll(STATUS_INTERVAL):
                    continue
                press = self._pipe.recv()
                if isinstance(press, StopPress):
                    self._mailbox.put(cmd.Stop(press.cause), press.actor)
        self._cut.set()

    def _report(self) -> None:
        publisher = self._loop.state_publisher
        last, reported, ticks, sent = None, 0.0, -1, None
        with GuardedPipe(self._pipe, PIPE):
            while not self._cut.is_set():
                if last is not None:
                    publisher.wait_for_change(last, STATUS_INTERVAL)
                last, now = publisher.snapshot, time.monotonic()
                state = last.state
                stopped = None if state.stopped is None else state.stopped.cause
                status = StopStatus(stopped, state.presses)
                due = now - reported >= STATUS_INTERVAL and self._loop.ticks != ticks
                if status != sent or due:
                    self._pipe.send(status)
                    sent, reported, ticks = status, now, self._loop.ticks
