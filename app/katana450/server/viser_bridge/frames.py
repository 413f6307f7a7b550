"""Frames on their way out: packed once for all who are sent the same, and only when they can be.

viser packs and compresses each window of messages for each browser anew, which for a crowd costs
more than all else the view does. What is sent here is what it sends; the hook is no public
interface of viser's, whose version is exact, and tests hold the frames to viser's own.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import msgspec
import zstandard
from viser.infra import _infra

MAX_KEPT_FRAMES = 4
"""Frames: browsers that keep up are sent the same within a turn of viser's loop."""

FRESH_SECONDS = 0.03
"""[s] A browser that comes later is sent what the messages say by then."""

ALIGNED = 8
"""Bytes: arrays begin at multiples of it."""

FRAME_SLOT_HEADER = "X-Katana450-Hatch"
"""Header in which the gateway names the hatch of a browser's line."""


class FrameSlot:
    """The passage between the gateway's and viser's end of one browser's connection.

    Frames come out in the gateway's thread, one when one is wanted.

    A frame that is made says what is so by then, and one that waits grows old; so none is made
    before. It is given from hand to hand, since a socket in between would cost a crowd as much as
    all the rest of its way.
    """

    def __init__(self, key: str = "", refused: Callable[[str], None] = lambda _: None) -> None:
        """Called in the loop of the taker of the frames.

        ``key``: of the window that the browser shows, empty for none. ``refused``: called in that
        loop with the reason why a gesture was refused.
        """
        self.name = secrets.token_hex(16)
        self.key = key
        self.stamps: deque[int] = deque()
        """Revocations at the receipt of each message on its way to viser, oldest first."""
        self._refused = refused
        self._frames: deque[bytes] = deque()
        self._taker = asyncio.get_running_loop()
        self._giver: asyncio.AbstractEventLoop | None = None
        self._came = asyncio.Event()
        self._wanted = asyncio.Event()
        _slots[self.name] = self

    def refuse(self, why: str) -> None:
        """Say why a gesture was refused; in any thread."""
        with suppress(RuntimeError):  # the loop may have ended
            self._taker.call_soon_threadsafe(self._refused, why)

    async def take(self) -> bytes:
        """The next frame; in the taker's loop."""
        while not self._frames:
            self._came.clear()
            if self._giver is not None:
                _signal(self._giver, self._wanted)
            await self._came.wait()
        return self._frames.popleft()

    def open(self) -> None:
        """Say that frames come, the first of them unasked; in the giver's loop."""
        self._giver = asyncio.get_running_loop()

    async def give(self, frame: bytes) -> None:
        """Give ``frame``, and return when another one is wanted; in the giver's loop."""
        self._wanted.clear()
        self._frames.append(frame)
        _signal(self._taker, self._came)
        await self._wanted.wait()


def _signal(loop: asyncio.AbstractEventLoop, event: asyncio.Event) -> None:
    with suppress(RuntimeError):  # the loop may have ended
        loop.call_soon_threadsafe(event.set)


_slots: WeakValueDictionary[str, FrameSlot] = WeakValueDictionary()


def slot_of(headers: Mapping[str, str]) -> FrameSlot | None:
    """Return the slot that a connection's ``headers`` name; None without one."""
    return _slots.get(headers.get(FRAME_SLOT_HEADER, ""))


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
        if known is not None and now - known.at < FRESH_SECONDS:
            return known.frame
        while len(self._packed) >= MAX_KEPT_FRAMES:
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
    slot = slot_of(line.request.headers)
    send = line.send
    if slot is not None:
        slot.open()
        send = slot.give
    windows = buffer.window_generator(client_id, backlog_done_message=backlog_done_message)
    try:
        async for window in windows:
            await send(packer.frame(window))
    finally:
        # An unfinished one would keep what it has not sent.
        await windows.aclose()


def share() -> None:
    """Have the viser servers of this process pack each frame once."""
    _infra._message_producer = produce  # type: ignore[assignment]  # without viser's types
