"""The proxy between browsers and viser, with the flow control of each connection."""

from __future__ import annotations

import asyncio
import logging
import math
from collections import deque
from contextlib import suppress
from typing import NamedTuple

import viser
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketDisconnected
from uvicorn.protocols.utils import ClientDisconnected
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from katana450.arm.control.lease import CommandChannel
from katana450.errors import InputError
from katana450.server.service.heartbeats import LeastDelay
from katana450.server.service.hub import Hub
from katana450.server.service.identity import PAGE, Identity
from katana450.server.service.limits import ConnectionLimit
from katana450.server.service.participants import actor_of, key_of
from katana450.server.viser_bridge.frames import FRAME_SLOT_HEADER, FrameSlot, Stamp
from katana450.server.viser_bridge.guard import FilterResult, Guard, MessageFilter, Ruling
from katana450.server.viser_bridge.viser_server import KEY_HEADER
from katana450.server.web.admission import address_of, reserved
from katana450.server.web.authenticator import SIGN_IN_CLOSE_CODE, Authenticator

log = logging.getLogger(__name__)

SUBPROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
"""The subprotocol of viser's page; only a page of the pinned version is served."""

MAX_FRAMES_PER_SECOND = 1000.0
"""Frames per second that one core can send to all browsers together. The driver is not limited."""

FRAME_INTERVAL = 1.0 / 60.0
"""Minimum time [s] between two frames of the view."""

RECHECK_INTERVAL = 0.1
"""Time [s] after which the backlog of a browser is checked again if it reports nothing."""

MAX_BROWSERS, MAX_BROWSERS_EACH, RESERVED_BROWSERS = 64, 16, 2
"""Maximum number of browsers with the scene at one time, in total and per identity, and number
reserved for the driver and for each admin."""

DRAWN_TIMEOUT = 1.0
"""Maximum time [s] for which the panel waits until the scene is drawn."""

REFUSAL_INTERVAL = 0.5
"""Minimum time [s] between two shown refusals: a drag sends 20 messages a second."""

OVERDUE = 0.3
"""Time [s] from sending to display, beyond the minimum delay, above which a frame is late."""

FORGET = 0.005
"""Maximum growth [s/s] of the estimated minimum delay."""

MIN_IN_FLIGHT_BYTES, FIRST_IN_FLIGHT_BYTES, MAX_IN_FLIGHT_BYTES = 2_048, 8_192, 262_144
"""Minimum, initial and maximum limit of bytes in flight.

The limit grows while all frames are in time, and halves when one is late.
"""

MAX_LINE_DELAY = 1.0
"""Maximum of the estimated minimum delay [s]."""

MAX_REMEMBERED_FRAMES = 4096
"""Maximum number of remembered frames: one minute, for a browser that never reports any."""


class Proxy:
    """Connects each browser to viser by a connection of its own."""

    def __init__(
        self, hub: Hub, authenticator: Authenticator, guard: Guard, port: int, key: str
    ) -> None:
        """Prepare connections to viser at ``port`` of this machine, with its ``key``."""
        self._hub = hub
        self._authenticator = authenticator
        self._guard = guard
        self._port = port
        self._key = key
        self._places = ConnectionLimit(MAX_BROWSERS, MAX_BROWSERS_EACH)

    async def serve(self, browser: WebSocket) -> None:
        """Answer a request for viser's socket."""
        identity = self._authenticator.identity(browser.cookies)
        if identity is None or SUBPROTOCOL not in browser.scope["subprotocols"]:
            await browser.close(1008)
            return
        places = reserved(self._hub, self._authenticator, identity, RESERVED_BROWSERS)
        with self._places.taken(identity.session, places) as free:
            if free:
                await self._serve(browser, identity)
            else:
                actor = actor_of(identity, CommandChannel.SCENE, address_of(browser))
                error = InputError("Too many pages show the scene. Close some windows.")
                self._hub.recorder.refuse("connection", actor, error)
                await browser.close(1013)

    async def _serve(self, browser: WebSocket, identity: Identity) -> None:
        page = browser.query_params.get("page", "")
        # Without our page around it, viser's page can only show the scene.
        key = key_of(identity, page) if PAGE.fullmatch(page) else ""
        line = _Line(self._hub, self._guard, browser, key)
        try:
            async with connect(
                f"ws://127.0.0.1:{self._port}",
                subprotocols=[SUBPROTOCOL],
                additional_headers={KEY_HEADER: self._key, FRAME_SLOT_HEADER: line.slot.name},
                ping_interval=None,
            ) as upstream:
                await browser.accept(SUBPROTOCOL)
                why = await self._authenticator.run_while_authorised(
                    lambda: self._authenticator.identity(browser.cookies),
                    line.run(upstream),
                )
                if why is not None:
                    await browser.close(SIGN_IN_CLOSE_CODE, why)
        except ClientDisconnected:
            log.debug("A page was closed before its scene could be sent.")
        except OSError as error:
            log.warning("viser does not answer: %s", str(error) or type(error).__name__)
            # A browser that has left needs no close frame.
            with suppress(WebSocketDisconnect, RuntimeError):
                await browser.close(1013)


class _Line:
    """The connection between one browser and viser."""

    def __init__(self, hub: Hub, guard: Guard, browser: WebSocket, key: str) -> None:
        self._hub = hub
        self._guard = guard
        self.slot = FrameSlot(key, self._refuse)
        self._browser = browser
        self._key = key
        self._flow = FlowControl()
        self._least_delay = LeastDelay()
        self._room = asyncio.Event()
        self._refused_at = float("-inf")
        self._due = float("-inf")
        self._unwelcome = False

    async def run(self, upstream: ClientConnection) -> None:
        """Pass messages until either side closes; ``upstream`` is the connection to viser."""
        self._hub.pictures.show(self._key, self._flow)
        directions = (self._down(), self._up(), upstream.wait_closed())
        tasks = [asyncio.create_task(direction) for direction in directions]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                with suppress(ConnectionClosed, WebSocketDisconnect, WebSocketDisconnected):
                    task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            # A close frame would wait behind frames that are not read any more.
            upstream.transport.abort()
            self._hub.pictures.hide(self._flow)
        # After the tasks have ended, so that no frame follows the close frame.
        if self._unwelcome:
            with suppress(WebSocketDisconnect, WebSocketDisconnected):
                await self._browser.close(1008)

    async def _down(self) -> None:
        """Send frames as fast as the browser shows them."""
        await self._send(await self.slot.take())
        if self._key:
            # What follows the scene, like the panel, must not delay its drawing.
            await self._until_drawn()
        while True:
            await asyncio.sleep(self._pause(self._hub.clock()))
            await self._wait_for_room()
            await self._send(await self.slot.take())

    async def _until_drawn(self) -> None:
        """Wait a while until the page has drawn something. One in the background draws nothing."""
        end = self._hub.clock() + DRAWN_TIMEOUT
        while not self._flow.counts and (left := end - self._hub.clock()) > 0.0:
            self._room.clear()
            with suppress(TimeoutError):
                # Not `wait_for`: in Python 3.11 it can lose the cancellation by `run`.
                async with asyncio.timeout(left):
                    await self._room.wait()

    async def _wait_for_room(self) -> None:
        while not self._flow.has_room(self._hub.clock()):
            self._room.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(RECHECK_INTERVAL):
                    await self._room.wait()

    def _pause(self, t: float) -> float:
        """Return the time [s] to wait before the next frame, so that many browsers share a core."""
        holder = self._hub.lease.holder
        interval = self._hub.pictures.watching / MAX_FRAMES_PER_SECOND
        if interval <= FRAME_INTERVAL or (holder is not None and holder.key == self._key):
            return 0.0
        self._due = max(self._due + interval, t)
        return self._due - t

    async def _up(self) -> None:
        """Pass the messages of the browser to viser that the message filter admits."""
        participant = self._hub.participant(self._key)
        who = participant.person.name if participant is not None else "a window without our page"
        message_filter = MessageFilter(self._guard, who, self._hub.clock())
        pass_on = await self.slot.receiver()
        while True:
            # At most one message per turn of the event loop, so that other tasks can run.
            await asyncio.sleep(0)
            message = await self._browser.receive()
            if message["type"] == "websocket.disconnect":
                return
            data = message.get("bytes")
            result = message_filter.judge(data, self._hub.clock())
            if result.ruling is Ruling.PASS:
                stamp = Stamp(self._hub.gate.revocations, self._delay(result))
                self.slot.stamps.append(stamp)
                pass_on(result.message)
            elif result.ruling is Ruling.CLOSE or not self._note(result):
                log.warning("Disconnected a browser that sent too many invalid messages.")
                self._unwelcome = True
                return

    def _note(self, result: FilterResult) -> bool:
        """Note the frames on the screen; return False if the reported number is impossible."""
        if result.seen is None:
            return True
        self._delay(result)
        self._room.set()
        return self._flow.seen(result.seen, self._hub.clock())

    def _delay(self, result: FilterResult) -> float:
        """Return the delay of a message beyond the least of this connection [s]."""
        if result.made is None:
            return 0.0
        moves = result.message is not None and self._guard.drives(result.message)
        limit = self._hub.gate.sample_delay if moves else math.inf
        return self._least_delay.excess(result.made, self._hub.clock(), limit)

    def _refuse(self, why: str) -> None:
        """Show in the browser's window why its gesture was refused."""
        participant, t = self._hub.participant(self._key), self._hub.clock()
        if participant is not None and t - self._refused_at >= REFUSAL_INTERVAL:
            self._refused_at = t
            participant.notify({"is": "refused", "why": why})

    async def _send(self, frame: bytes) -> None:
        await self._browser.send_bytes(frame)
        self._flow.sent(len(frame), self._hub.clock())


class _Sent(NamedTuple):
    t: float
    size: int


class FlowControl:
    """The lag of one browser, and how much more may be sent to it. Times are arguments [s].

    The page reports the number of frames on its screen. The bytes that were sent and not yet seen
    are limited to the amount that the connection recently carried in time. At the limit no frame is
    taken from viser, which meanwhile replaces its waiting messages by newer ones. A slow connection
    therefore shows fewer frames instead of old ones.

    Attributes:
        counts: whether the browser reports the frames on its screen. Our page does, other programs
            do not.
    """

    def __init__(self) -> None:
        self._in_flight: deque[_Sent] = deque(maxlen=MAX_REMEMBERED_FRAMES)
        self._bytes = 0
        self._window = FIRST_IN_FLIGHT_BYTES
        self._min_delay: float | None = None
        self._reported_at = 0.0
        self._sent = 0
        self.counts = False

    def sent(self, size: int, t: float) -> None:
        """Note that a frame of ``size`` bytes was sent at ``t``."""
        self._sent += 1
        self._in_flight.append(_Sent(t, size))
        self._bytes += size

    def seen(self, count: int, t: float) -> bool:
        """Note that ``count`` frames are on the screen at ``t``; return False if impossible."""
        missing = self._sent - count
        if not 0 <= missing <= len(self._in_flight):
            return False
        frames = [self._in_flight.popleft() for _ in range(len(self._in_flight) - missing)]
        if not self.counts:
            # The first frames contain the whole scene, so their delay says little about later ones.
            self.counts = True
            self._bytes = sum(frame.size for frame in self._in_flight)
        elif frames:
            size = sum(frame.size for frame in frames)
            filled = 2 * self._bytes >= self._window
            self._bytes -= size
            delay = t - frames[-1].t
            known = (
                delay
                if self._min_delay is None
                else self._min_delay + FORGET * (t - self._reported_at)
            )
            self._min_delay = min(known, delay, MAX_LINE_DELAY)
            self._reported_at = t
            if t - frames[0].t > self._min_delay + OVERDUE:
                self._window = max(self._window // 2, MIN_IN_FLIGHT_BYTES)
            elif filled:
                # A window that was never filled is untested. If the connection became slow, all of
                # it would be in flight at once (RFC 7661, congestion window validation).
                self._window = min(self._window + size // 2, MAX_IN_FLIGHT_BYTES)
        return True

    def age(self, t: float) -> float:
        """Return the age [s] at ``t`` of the oldest frame in flight; 0 if there is none."""
        if not (self.counts and self._in_flight):
            return 0.0
        return t - self._in_flight[0].t

    def has_room(self, t: float) -> bool:
        """Return whether another frame may be sent at ``t``."""
        if not (self.counts and self._in_flight):
            return True
        in_time = t - self._in_flight[0].t < OVERDUE + (self._min_delay or 0.0)
        return in_time and self._bytes < self._window
