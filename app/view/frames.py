"""Frames on their way out: packed once for all who are sent the same, and only when they can be.

viser packs and compresses each window of messages for each browser anew, which for a crowd costs
more than all else the view does. What is sent here is what it sends; the hook is no public
interface of viser's, whose version is exact, and tests hold the frames to viser's own.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import msgspec
import zstandard
from viser.infra import _infra

KEPT = 4
"""Frames: browsers that keep up are sent the same within a turn of viser's loop."""

FRESH = 0.03
"""[s] A browser that comes later is sent what the messages say by then."""

ALIGNED = 8
"""Bytes: arrays begin at multiples of it."""


VALVE_HEADER = "X-Katana450-Valve"
"""Header in which the gateway names the valve of a browser's line."""


class Valve:
    """Holds back what would only wait on the way to one browser.

    A frame that is made says what is so by then; one that waits grows old. The gateway shuts and
    opens it from its own thread.
    """

    def __init__(self) -> None:
        self.name = secrets.token_hex(16)
        self._is_open = True
        self._changed = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        _valves[self.name] = self

    def let(self, is_open: bool) -> None:
        """Open it or shut it. For any thread."""
        self._is_open = is_open
        if self._loop is not None:
            with suppress(RuntimeError):  # viser's loop may have ended
                self._loop.call_soon_threadsafe(self._changed.set)

    async def passed(self) -> None:
        """Return while it is open; in viser's loop."""
        # Known before the look, so that whoever opens it after the look is heard.
        self._loop = asyncio.get_running_loop()
        while not self._is_open:
            self._changed.clear()
            await self._changed.wait()


_valves: WeakValueDictionary[str, Valve] = WeakValueDictionary()


class _Packed(NamedTuple):
    at: float
    frame: bytes
    window: Sequence[Any]
    """Kept, so that no other message has the number of one of these meanwhile."""


class Packer:
    """Packs windows of messages, each once while it is fresh."""

    def __init__(self) -> None:
        self._packed: dict[tuple[int, ...], _Packed] = {}
        self._compress = zstandard.ZstdCompressor(level=1).compress

    def frame(self, window: Sequence[Any]) -> bytes:
        """The frame of these messages."""
        now = time.perf_counter()
        key = tuple(map(id, window))
        known = self._packed.get(key)
        if known is not None and now - known.at < FRESH:
            return known.frame
        while len(self._packed) >= KEPT:
            del self._packed[next(iter(self._packed))]
        frame = self._pack(window, now)
        self._packed[key] = _Packed(now, frame, window)
        return frame

    def _pack(self, window: Sequence[Any], now: float) -> bytes:
        arrays: list[memoryview] = []
        messages = tuple(message.as_serializable_dict(arrays) for message in window)
        packed = msgspec.msgpack.encode(
            {
                "messages": messages,
                "timestampSec": now,
                "binaryBufferLengths": tuple(array.nbytes for array in arrays),
            }
        )
        compressed = self._compress(packed)
        frame = bytearray(len(packed).to_bytes(8, "little"))
        frame += len(compressed).to_bytes(8, "little")
        frame += compressed
        for array in arrays:
            frame += bytes(-len(frame) % ALIGNED)
            frame += array
        return bytes(frame)


async def produce(line: Any, buffer: Any, client_id: int, backlog_done_message: Any = None) -> None:
    """Send a browser the windows of a buffer, as viser's own producer of this name does."""
    packer = buffer.__dict__.setdefault("packer", Packer())
    valve = _valves.get(line.request.headers.get(VALVE_HEADER, ""))
    windows = buffer.window_generator(client_id, backlog_done_message=backlog_done_message)
    try:
        async for window in windows:
            await line.send(packer.frame(window))
            # What is for one browser alone is an answer, and does not repeat itself.
            if valve is not None and buffer.persistent_messages:
                await valve.passed()
    finally:
        # An unfinished one would keep what it has not sent.
        await windows.aclose()


def share() -> None:
    """Have the viser servers of this process pack each frame once."""
    _infra._message_producer = produce  # type: ignore[assignment]  # without viser's types
