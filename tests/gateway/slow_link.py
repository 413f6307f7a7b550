"""A connection of limited rate between a client and a server."""

from __future__ import annotations

import asyncio
import math
import random
import socket
import threading
from contextlib import suppress
from typing import Self

SLICE = 0.02
"""Time [s] whose data the line carries in one burst."""

WINDOW = 8192
"""Bytes that the line buffers in each direction."""


class SlowLink:
    """Context manager that relays connections from ``port`` to ``to_port`` on this machine.

    ``rate``: bytes per second in each direction for all connections together. ``delay``: one-way
    delay [s], which can be changed; with ``late_answers`` it holds for the server's data alone.
    ``cut`` silences the line without closing it.
    """

    def __init__(self, to_port: int, rate: float, delay: float = 0.0) -> None:
        self.rate = rate
        self.cut = False
        self.delay = delay
        self.late_answers = False
        self._to_port = to_port
        self._loop = asyncio.new_event_loop()
        self._listening = socket.create_server(("127.0.0.1", 0))
        # Larger buffers of the kernel would hold seconds of data of a slow line.
        self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, WINDOW)
        self._free_at = [0.0, 0.0]
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def port(self) -> int:
        """Return the port of the client's end."""
        port: int = self._listening.getsockname()[1]
        return port

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(
            asyncio.start_server(self._relay, sock=self._listening, limit=WINDOW)
        )
        self._loop.run_forever()
        server.close()
        # A task that never begins would leave the connection open that was just accepted.
        self._loop.run_until_complete(asyncio.sleep(0.01))
        tasks = asyncio.all_tasks(self._loop)
        for task in tasks:
            task.cancel()
        self._loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
        # Aborted connections end in the next turn of the loop.
        self._loop.run_until_complete(asyncio.sleep(0.0))
        self._loop.close()

    async def _relay(self, near: asyncio.StreamReader, back: asyncio.StreamWriter) -> None:
        line = socket.socket()
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, WINDOW)
        line.setblocking(False)
        ends, tasks = [back], list[asyncio.Task[None]]()
        # A server that is down ends the connection, and so does the end of this line.
        with suppress(OSError, asyncio.CancelledError):
            try:
                await self._loop.sock_connect(line, ("127.0.0.1", self._to_port))
                far, forth = await asyncio.open_connection(sock=line, limit=WINDOW)
                ends.append(forth)
                tasks += [
                    asyncio.create_task(self._carry(near, forth, 0)),
                    asyncio.create_task(self._carry(far, back, 1)),
                ]
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for end in ends:
                    end.transport.abort()
                if len(ends) == 1:
                    line.close()
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    async def _carry(
        self, source: asyncio.StreamReader, to: asyncio.StreamWriter, way: int
    ) -> None:
        to.transport.set_write_buffer_limits(high=WINDOW)
        while data := await source.read(max(int(self.rate * SLICE), 64)):
            now = self._loop.time()
            self._free_at[way] = max(self._free_at[way], now) + len(data) / self.rate
            delay = 0.0 if self.late_answers and way == 0 else self.delay
            await asyncio.sleep(self._free_at[way] - now + delay)
            while self.cut:
                await asyncio.sleep(SLICE)
            to.write(data)
            await to.drain()


class DelayedLink(SlowLink):
    """Context manager that relays connections from ``port`` to ``to_port`` on this machine.

    ``delay`` [s] holds in each direction for all data that comes from now on, and so does
    ``jitter`` [s], the maximum of a random delay that is added. Data keeps its order.
    """

    def __init__(self, to_port: int, delay: float = 0.0, jitter: float = 0.0) -> None:
        super().__init__(to_port, math.inf, delay)
        self.jitter = jitter
        self._random = random.Random(450)

    async def _carry(
        self, source: asyncio.StreamReader, to: asyncio.StreamWriter, _way: int
    ) -> None:
        due = 0.0
        while data := await source.read(WINDOW):
            delay = self.delay + self._random.uniform(0.0, self.jitter)
            due = max(due, self._loop.time() + delay)
            self._loop.call_at(due, _write, to, data)


def _write(to: asyncio.StreamWriter, data: bytes) -> None:
    # The other side may have left meanwhile.
    if not to.is_closing():
        to.write(data)
