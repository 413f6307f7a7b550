"""Frames on their way out, packed once for all browsers that are sent the same.

viser packs and compresses each window of messages for each browser anew, which for a crowd costs
more than all else the view does. What is sent here is what it sends; the hook is no public
interface of viser's, whose version is exact, and tests hold the frames to viser's own.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec
import zstandard
from viser.infra import _infra

KEPT = 4
"""Frames: browsers that keep up are sent the same within a turn of viser's loop."""

FRESH = 0.03
"""[s] A browser that comes later is sent what the messages say by then."""

ALIGNED = 8
"""Bytes: arrays begin at multiples of it."""


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
    windows = buffer.window_generator(client_id, backlog_done_message=backlog_done_message)
    try:
        async for window in windows:
            await line.send(packer.frame(window))
    finally:
        # An unfinished one would keep what it has not sent.
        await windows.aclose()


def share() -> None:
    """Have the viser servers of this process pack each frame once."""
    _infra._message_producer = produce  # type: ignore[assignment]  # without viser's types
