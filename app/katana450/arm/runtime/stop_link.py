"""End of the pipe to the arm, in the process of STOP."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection

from katana450.arm.control.stop_cause import StopCause
from katana450.arm.runtime.readiness import writable
from katana450.arm.runtime.stop_messages import StopPress, StopStatus


class StopLink:
    """Sends presses of STOP to the arm's process and holds the newest answer.

    It belongs to the event loop in which it is created. A thread of its own reads the pipe, and
    connects again when the arm's process was started again.
    """

    def __init__(self, connect: Callable[[], Connection]) -> None:
        """Connect from now on.

        ``connect``: waits for the arm's process and returns a pipe to it; raises EOFError at the
        end of this process.
        """
        self._connect = connect
        self._pipe: Connection | None = None
        self._loop = asyncio.get_running_loop()
        self._heard = time.monotonic()
        self._changed = asyncio.Event()
        self.status: StopStatus | None = None
        """The newest status; None before the arm is ready."""
        threading.Thread(target=self._listen, name="stop link", daemon=True).start()

    @property
    def age(self) -> float:
        """Time since the newest message of the arm's process [s]; a running loop has sent it."""
        return time.monotonic() - self._heard

    def press(self, press: StopPress) -> None:
        """Send ``press``. A pipe that is full, with earlier presses, does not block."""
        pipe = self._pipe
        if pipe is None:
            return
        with suppress(OSError):
            if writable(pipe.fileno()):
                pipe.send(press)

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
                self._pipe = self._connect()
                with suppress(EOFError, OSError):
                    while True:
                        self._call(self._take, self._pipe.recv())
                self._pipe = None

    def _call(self, act: Callable[..., None], *values: object) -> None:
        # The event loop is closed when the process ends.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(act, *values)

    def _take(self, status: StopStatus) -> None:
        self._heard = time.monotonic()
        self.status = status
        self._changed.set()
