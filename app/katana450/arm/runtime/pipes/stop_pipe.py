"""End of the pipe to the arm, in the process of STOP."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection

from katana450.arm.control.state.stop_cause import StopCause
from katana450.arm.runtime.pipes.guarded_pipe import GuardedPipe
from katana450.arm.runtime.pipes.stop_messages import StopPress, StopStatus
from katana450.arm.runtime.readiness import writable

MAX_UNSENT = 16
"""Number of presses that are kept while there is no connection; one stops the arm."""


class StopPipe:
    """Sends presses of STOP to the arm's process and holds the newest answer.

    It belongs to the event loop in which it is created; a thread of its own reads the pipe.
    """

    def __init__(self, connect: Callable[[], Connection]) -> None:
        """Connect and read from now on.

        Args:
            connect: returns a connection to the arm's process, also after one was cut; raises
                EOFError if there will be no further one. Called in the thread.
        """
        self._connect = connect
        self._pipe: Connection | None = None
        self._unsent: deque[StopPress] = deque(maxlen=MAX_UNSENT)
        self._loop = asyncio.get_running_loop()
        self._heard = time.monotonic()
        self._changed = asyncio.Event()
        self.status: StopStatus | None = None
        """The newest status; None while there is no connection to the arm."""
        self._thread = threading.Thread(target=self._listen, name="stop pipe", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """True while the thread reads; False once it has ended for any reason."""
        return self._thread.is_alive()

    @property
    def age(self) -> float:
        """Time since the newest message of the arm's process [s]; a running loop has sent it."""
        return time.monotonic() - self._heard

    def press(self, press: StopPress) -> None:
        """Send ``press``, or keep it for the next connection.

        A pipe that is full, with earlier presses, does not block.
        """
        try:
            if self._pipe is None:
                self._unsent.append(press)
            elif writable(self._pipe.fileno()):
                self._pipe.send(press)
        except OSError:
            self._unsent.append(press)

    async def executed(self, press: str, timeout: float) -> StopCause | None:
        """Return the cause of the stop once a state includes ``press``; None after ``timeout`` [s].

        The cause names the first of several presses.
        """
        with suppress(TimeoutError):
            async with asyncio.timeout(timeout):
                while True:
                    status = self.status
                    if status is not None and status.stopped and press in status.presses:
                        return status.stopped
                    self._changed.clear()
                    await self._changed.wait()
        return None

    def _listen(self) -> None:
        with suppress(EOFError):
            while True:
                pipe = self._connect()
                self._call(self._attach, pipe)
                with GuardedPipe(pipe, "The pipe of STOP to the arm's process"):
                    while True:
                        status = pipe.recv()
                        self._heard = time.monotonic()
                        # The same status again needs no turn of the event loop.
                        if status != self.status:
                            self._call(self._take, status)
                self._call(self._attach, None)

    def _call(self, act: Callable[..., None], *values: object) -> None:
        # The event loop is closed when the process ends.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(act, *values)

    def _attach(self, pipe: Connection | None) -> None:
        """Use the new connection ``pipe``; None once it is cut."""
        self._pipe, self.status = pipe, None
        if pipe is not None:
            unsent, self._unsent = self._unsent, deque(maxlen=MAX_UNSENT)
            for press in unsent:
                self.press(press)

    def _take(self, status: StopStatus) -> None:
        self.status = status
        self._changed.set()
