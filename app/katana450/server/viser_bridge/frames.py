"""Frames for the browsers: packed once for all browsers, and only when a browser can take one.

viser packs and compresses each window of messages separately for each browser. For many browsers
this costs more than the rest of the view. The frames here are identical to viser's. The hook is a
private part of viser, so its version is pinned, and tests compare the frames with viser's own.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import msgspec
import zstandard
from viser import _messages as wire
from viser.infra import _infra

MAX_KEPT_FRAMES = 4
"""Maximum number of kept frames. Fast browsers get the same frame in one turn of viser's loop."""

FRESH_SECONDS = 0.03
"""Time [s] after which a window is packed again, because its messages may have changed."""

MAX_WINDOW = 1024
"""Maximum number of messages in a frame, more than those of a whole scene: a page that gets it in
parts draws every part."""

ALIGNED = 8
"""Alignment of arrays in a frame [bytes]."""

FRAME_SLOT_HEADER = "X-Katana450-Frame-Slot"
"""Header in which the gateway names the frame slot of a browser's connection."""


class Stamp(NamedTuple):
    """The receipt of a message of a browser.

    Attributes:
        revocations: number of revocations at that time.
        delay: delay [s] beyond the least of the connection; 0 if unknown.
    """

    revocations: int
    delay: float = 0.0


class FrameSlot:
    """The passage between the gateway's and viser's end of one browser's connection.

    viser's thread puts frames in, and the gateway's thread takes them out, one on each request. A
    frame is made only on request, because a waiting frame would grow old. It is passed directly,
    because a socket in between would double the cost for many browsers. Messages of the browser go
    the other way, decoded already: by the socket a drag would be shown later.

    Attributes:
        name: secret name by which viser's end finds the slot.
        key: key of the window that the browser shows, empty if there is none.
        stamps: the receipt of each message on its way to viser, oldest first.
    """

    def __init__(self, key: str = "", refused: Callable[[str], None] = lambda _: None) -> None:
        """Make a slot. Call it in the event loop that takes the frames.

        Args:
            key: Key of the window that the browser shows, empty if there is none.
            refused: Called in that loop with the reason for which a gesture was refused.
        """
        self.name = secrets.token_hex(16)
        self.key = key
        self.stamps: deque[Stamp] = deque()
        self._refused = refused
        self._frames: deque[bytes] = deque()
        self._taker = asyncio.get_running_loop()
        self._giver: asyncio.AbstractEventLoop | None = None
        self._handle: Callable[[Any], None] = lambda _: None
        self._heard = asyncio.Event()
        self._available = asyncio.Event()
        self._requested = asyncio.Event()
        _slots[self.name] = self

    def refuse(self, why: str) -> None:
        """Report the reason for which a gesture was refused. May be called in any thread."""
        _soon(self._taker, self._refused, why)

    async def take(self) -> bytes:
        """Return the next frame. Call it in the taker's loop."""
        while not self._frames:
            self._available.clear()
            if self._giver is not None:
                _soon(self._giver, self._requested.set)
            await self._available.wait()
        return self._frames.popleft()

    def open(self) -> None:
        """Register the giver's loop, which must call it. The first frame needs no request."""
        self._giver = asyncio.get_running_loop()

    def hear(self, handle: Callable[[Any], None]) -> None:
        """Call ``handle`` in this loop, that of the giver, with each message of the browser."""
        self.open()
        self._handle = handle
        _soon(self._taker, self._heard.set)

    async def receiver(self) -> Callable[[Any], None]:
        """Wait until viser listens, and return the function that passes it a message.

        Append the stamp of the message to ``stamps`` first.
        """
        await self._heard.wait()
        return partial(_soon, self._giver, self._handle)

    async def give(self, frame: bytes) -> None:
        """Hand over ``frame``, in the giver's loop, and return when the next one is requested."""
        self._requested.clear()
        self._frames.append(frame)
        _soon(self._taker, self._available.set)
        await self._requested.wait()


def _soon(loop: Any, act: Callable[..., object], *arguments: Any) -> None:
    """Call ``act`` in ``loop``, which may have ended."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(act, *arguments)


_slots: WeakValueDictionary[str, FrameSlot] = WeakValueDictionary()


def slot_of(headers: Mapping[str, str]) -> FrameSlot | None:
    """Return the slot that the ``headers`` of a connection name; None if there is none."""
    return _slots.get(headers.get(FRAME_SLOT_HEADER, ""))


class _Packed(NamedTuple):
    """A packed frame.

    Attributes:
        at: time of packing [s].
        frame: the bytes.
        window: the messages. They are kept so that no other message gets the id of one of them.
    """

    at: float
    frame: bytes
    window: Sequence[Any]


class Packer:
    """Packs windows of messages, and each window only once while it is fresh."""

    def __init__(self) -> None:
        self._packed: dict[tuple[int, ...], _Packed] = {}
        self._compress = zstandard.ZstdCompressor(level=1).compress

    def frame(self, window: Sequence[Any]) -> bytes:
        """Return the frame of the messages in ``window``."""
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


def in_parts(window: Sequence[Any]) -> list[Sequence[Any]]:
    """Return the messages of a scene in the order in which a page needs them, in up to three parts.

    First what is seen in the scene, then the panel, then hidden nodes. The order within a part
    stays, and the last message, which ends the scene, remains the last.
    """
    hidden = tuple(
        f"{message.name}/"
        for message in window
        if isinstance(message, wire.SetSceneNodeVisibilityMessage) and not message.visible
    )
    visible: list[Any] = []
    panel: list[Any] = []
    unseen: list[Any] = []
    for message in window[:-1]:
        kind, name = type(message).__name__, getattr(message, "name", "")
        if kind.startswith("Gui") and not kind.startswith("GuiSetPanel"):
            panel.append(message)
        elif f"{name}/".startswith(hidden):
            unseen.append(message)
        else:
            visible.append(message)
    return [part for part in (visible, panel, [*unseen, window[-1]]) if part]


async def produce(line: Any, buffer: Any, client_id: int, backlog_done_message: Any = None) -> None:
    """Send a browser the windows of a buffer, as viser's own ``_message_producer`` does.

    A whole scene is sent in parts.
    """
    packer = buffer.__dict__.setdefault("packer", Packer())
    buffer.max_window_size = MAX_WINDOW
    slot = slot_of(line.request.headers)
    send = line.send
    if slot is not None:
        slot.open()
        send = slot.give
    windows = buffer.window_generator(client_id, backlog_done_message=backlog_done_message)
    try:
        async for window in windows:
            whole = backlog_done_message is not None and window[-1] is backlog_done_message
            for part in in_parts(window) if whole else (window,):
                await send(packer.frame(part))
    finally:
        # An unfinished generator would keep its unsent messages.
        await windows.aclose()


async def consume(line: Any, handle: Callable[[Any], None], message_class: Any) -> None:
    """Take the messages of a browser, as viser's own ``_message_consumer`` does.

    Those of a browser behind the gateway come by its slot, and nothing by the socket.
    """
    slot = slot_of(line.request.headers)
    if slot is not None:
        slot.hear(handle)
    await _own_consumer(line, handle, message_class)


_own_consumer = _infra._message_consumer


def share() -> None:
    """Make the viser servers of this process pack each frame once, and use the slots."""
    _infra._message_producer = produce  # type: ignore[assignment]  # without viser's types
    _infra._message_consumer = consume  # type: ignore[assignment]
