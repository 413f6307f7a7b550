"""Frames that are packed once are identical to viser's own."""

from __future__ import annotations

import asyncio
import importlib.util
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
import zstandard
from viser import _messages as wire
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

from katana450.server.viser_bridge import frames
from katana450.server.viser_bridge.viser_server import open_server


def visers_own(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the producer of an unchanged viser."""
    assert _infra.__file__ is not None
    spec = importlib.util.spec_from_file_location("viser.infra._untouched", _infra.__file__)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses of the module look it up in sys.modules.
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    return module._message_producer


class Line:
    """A connection that records sent frames."""

    def __init__(self, slot: frames.FrameSlot | None = None) -> None:
        self.sent: list[bytes] = []
        self.request = SimpleNamespace(
            headers={} if slot is None else {frames.FRAME_SLOT_HEADER: slot.name}
        )

    async def send(self, frame: bytes) -> None:
        self.sent.append(frame)


@contextmanager
def thread_of_viser() -> Iterator[asyncio.AbstractEventLoop]:
    """Run an event loop in a thread of its own, as viser's in the app."""
    viser = asyncio.new_event_loop()
    thread = threading.Thread(target=viser.run_forever)
    thread.start()
    try:
        yield viser
    finally:
        viser.call_soon_threadsafe(viser.stop)
        thread.join()
        viser.close()


def messages() -> list[Any]:
    rings = np.arange(21.0, dtype=np.float32).reshape(3, 7)
    return [
        wire.SetOrientationMessage("/a", (1.0, 0.0, 0.0, 0.0)),
        wire.SceneNodeUpdateMessage(
            "/b", {"batched_wxyzs": rings[:, :4].copy(), "batched_positions": rings[:, 4:].copy()}
        ),
        wire.SetPositionMessage("/b", (0.1, 0.2, 0.3)),
    ]


async def send_to(lines: dict[int, tuple[Any, Line]], pushed: list[list[Any]]) -> None:
    """Send each list of messages to all connections by their producers."""
    buffer = AsyncMessageBuffer(asyncio.get_running_loop(), persistent_messages=True)
    tasks = [
        asyncio.create_task(produce(line, buffer, number))
        for number, (produce, line) in lines.items()
    ]
    for queued in pushed:
        buffer.atomic_start()
        for message in queued:
            buffer.push(message)
        buffer.atomic_end()
        buffer.flush()
        await asyncio.sleep(0.1)
    buffer.set_done()
    await asyncio.gather(*tasks)


def opened(frame: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the content of a frame without its time, and the bytes of its arrays."""
    size, packed = (int.from_bytes(frame[offset : offset + 8], "little") for offset in (0, 8))
    body = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed])
    assert len(body) == size
    decoded = msgspec.msgpack.decode(body)
    assert decoded.pop("timestampSec") > 0.0
    arrays = 16 + packed
    # The arrays are aligned so that the page can use them without a copy.
    return decoded, frame[arrays + -arrays % 8 :]


def test_frames_are_identical_to_those_of_viser(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, own = Line(), Line()
    pushed = [messages(), messages()[:1], messages()[1:]]
    asyncio.run(send_to({1: (frames.produce, ours), 2: (visers_own(monkeypatch), own)}, pushed))
    assert len(ours.sent) == len(own.sent) == 3
    for mine, visers in zip(ours.sent, own.sent, strict=True):
        assert opened(mine) == opened(visers)


def test_frames_for_many_browsers_are_packed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    packed: list[int] = []
    pack = frames.Packer._pack

    def counted(packer: frames.Packer, window: Any, now: float) -> bytes:
        packed.append(len(window))
        return pack(packer, window, now)

    monkeypatch.setattr(frames.Packer, "_pack", counted)
    lines = [Line() for _ in range(20)]
    pushed = [messages() for _ in range(3)]
    asyncio.run(send_to({n: (frames.produce, line) for n, line in enumerate(lines)}, pushed))
    assert packed == [3, 3, 3]
    assert all(line.sent == lines[0].sent for line in lines)


def test_unread_state_is_replaced_by_a_newer_one() -> None:
    async def take(slot: frames.FrameSlot) -> list[float]:
        messages = opened(await slot.take())[0]["messages"]
        return [message["position"][0] for message in messages]

    async def act(viser: asyncio.AbstractEventLoop) -> None:
        slot = frames.FrameSlot()

        async def begin() -> tuple[Any, Any]:
            buffer = AsyncMessageBuffer(viser, persistent_messages=True)
            return buffer, asyncio.create_task(frames.produce(Line(slot), buffer, 1))

        submit = partial(asyncio.run_coroutine_threadsafe, loop=viser)
        buffer, producing = await asyncio.wrap_future(submit(begin()))

        async def push(*xs: float) -> None:
            for x in xs:
                buffer.push(wire.SetPositionMessage("/a", (x, 0.0, 0.0)))
                buffer.flush()
                await asyncio.sleep(0.05)

        await push(1.0, 2.0, 3.0)
        assert await take(slot) == [1.0]
        assert await take(slot) == [3.0]
        waiting = asyncio.create_task(take(slot))
        await asyncio.sleep(0.1)
        assert not waiting.done()
        await push(4.0, 5.0)
        assert await waiting == [4.0]
        assert await take(slot) == [5.0]

        async def end() -> None:
            producing.cancel()
            with suppress(asyncio.CancelledError):
                await producing

        await asyncio.wrap_future(submit(end()))

    with thread_of_viser() as viser:
        asyncio.run(act(viser))


def test_changed_message_is_packed_again() -> None:
    packer = frames.Packer()
    props = {"visible": True}
    window = [wire.SceneNodeUpdateMessage("/a", props)]
    before = packer.frame(window)
    assert packer.frame(window) is before
    props["visible"] = False
    asyncio.run(asyncio.sleep(2 * frames.FRESH_SECONDS))
    assert opened(packer.frame(window)) != opened(before)


def test_deleted_messages_are_not_mistaken_for_later_ones() -> None:
    packer = frames.Packer()
    for number in range(200):
        # Python gives a new message the address, and so the id, of a deleted one.
        body, _ = opened(packer.frame([wire.SetPositionMessage(f"/{number}", (0.0, 0.0, 0.0))]))
        assert body["messages"][0]["name"] == f"/{number}"


def test_server_of_the_app_uses_our_producer() -> None:
    open_server("a key").stop()
    assert _infra._message_producer is frames.produce
    assert _infra._message_consumer is frames.consume


def test_messages_of_a_browser_wait_for_viser_and_keep_their_order_and_stamps() -> None:
    heard: list[tuple[str, frames.Stamp]] = []

    async def act(viser: asyncio.AbstractEventLoop) -> None:
        slot = frames.FrameSlot()
        submit = partial(asyncio.run_coroutine_threadsafe, loop=viser)

        def handle(message: str) -> None:
            # As viser does, which may answer one message while the next one comes.
            heard.append((message, slot.stamps.popleft()))

        async def begin() -> None:
            slot.hear(handle)

        receiver = asyncio.create_task(slot.receiver())
        await asyncio.sleep(0.05)
        # viser's end of the connection is not there yet.
        assert not receiver.done()
        await asyncio.wrap_future(submit(begin()))
        pass_on = await receiver
        for number in range(100):
            slot.stamps.append(frames.Stamp(number))
            pass_on(f"{number}")
        await asyncio.wrap_future(submit(asyncio.sleep(0.0)))

    with thread_of_viser() as viser:
        asyncio.run(act(viser))
    assert heard == [(f"{number}", frames.Stamp(number)) for number in range(100)]


def test_messages_after_the_end_of_viser_are_dropped() -> None:
    async def act(viser: asyncio.AbstractEventLoop) -> frames.FrameSlot:
        slot = frames.FrameSlot()

        async def begin() -> None:
            slot.hear(lambda _: None)

        await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(begin(), viser))
        return slot

    async def all_of_it() -> None:
        with thread_of_viser() as viser:
            slot = await act(viser)
        # Raises nothing, although the loop is closed.
        (await slot.receiver())("late")

    asyncio.run(all_of_it())


def test_scene_is_sent_in_the_order_in_which_it_is_needed() -> None:
    def node(name: str, *, visible: bool) -> list[Any]:
        return [
            wire.SetPositionMessage(name, (0.0, 0.0, 0.0)),
            wire.SetSceneNodeVisibilityMessage(name, visible),
        ]

    end = wire.ReplayDoneMessage()
    slider = wire.GuiUpdateMessage("id", {"value": 1.0})
    window = [
        *node("/ghost", visible=False),
        *node("/ghost/link", visible=True),
        slider,
        *node("/ghosts", visible=True),
        wire.SetPositionMessage("/ghost", (1.0, 0.0, 0.0)),
        end,
    ]
    shown, panel, unseen = frames.in_parts(window)
    assert [message.name for message in shown] == ["/ghosts", "/ghosts"]
    assert panel == [slider]
    assert unseen == [*window[:4], window[-2], end]
    assert frames.in_parts([end]) == [[end]]
