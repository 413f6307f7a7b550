"""Gestures at viser's handles, panels and ghosts: mapped to actors, and admitted or refused.

viser stores the new value of a control and sends it to the other browsers before it calls any
callback. `CommandGate` therefore checks each gesture first. A refused gesture never reaches viser,
and its window shows the old value again. The callback's command then goes through
`CommandGate.submit`, which decides.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import viser
from viser import _messages as wire

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor
from katana450.errors import LeaseError
from katana450.server.service.heartbeats import check_in_time
from katana450.server.service.hub import Hub
from katana450.server.viser_bridge.frames import FrameSlot, Stamp, slot_of
from katana450.server.viser_bridge.guard import Guard

DRAGGING = (wire.TransformControlsUpdateMessage, wire.TransformControlsDragEndMessage)
"""Messages of a drag after its start."""


@dataclass
class _Browser:
    """One browser's connection at viser's end.

    Attributes:
        connection: viser's own connection, for messages to this browser only.
        slot: the passage to the gateway's end.
        drags: actor of each current drag, by the name of the handle.
        actor: actor of the newest gesture.
    """

    connection: Any
    slot: FrameSlot
    drags: dict[str, Actor] = field(default_factory=dict)
    actor: Actor | None = None


class Gestures:
    """Maps viser's browsers to actors. Runs in viser's event loop.

    The hook is a private part of viser, so its version is pinned, and tests with raw sockets check
    it.
    """

    def __init__(self, server: viser.ViserServer, guard: Guard, hub: Hub) -> None:
        self._guard = guard
        self._hub = hub
        self._gate = hub.gate
        self._browsers: dict[int, _Browser] = {}
        websocket = server._websock_server
        self._pass_on = websocket._handle_incoming_message
        websocket._handle_incoming_message = self._handle  # type: ignore[method-assign]
        websocket.on_client_connect(self._meet)
        # After viser's own callback, which still ends the drags of a browser that has left.
        websocket.on_client_disconnect(self._part)
        self._websocket = websocket

    def actor(self, client_id: int | None) -> Actor:
        """Return the actor of the gesture that viser just reported.

        ``client_id`` is that of viser's event. Call this method before the callback awaits
        anything. Raises LeaseError if no gesture of that browser was admitted.
        """
        browser = None if client_id is None else self._browsers.get(client_id)
        if browser is None or browser.actor is None:
            raise LeaseError("Open the start page to drive the arm.")
        return browser.actor

    def client_of(self, key: str) -> int | None:
        """Return viser's id of the browser that shows the window ``key``; None without one."""
        # The newest connection of a window that has reconnected.
        return max((n for n, b in [*self._browsers.items()] if b.slot.key == key), default=None)

    def submit(self, command: cmd.Command, actor: Actor) -> int:
        """See ``CommandGate.submit``."""
        return self._gate.submit(command, actor)

    def is_current(self, actor: Actor) -> bool:
        """See ``CommandGate.is_current``."""
        return self._gate.is_current(actor)

    async def _meet(self, connection: Any) -> None:
        line = self._websocket._live_connections[connection.client_id]
        slot = slot_of(line.request.headers) if line.request else None
        if slot is not None:
            self._browsers[connection.client_id] = _Browser(connection, slot)

    def _part(self, connection: Any) -> None:
        self._browsers.pop(connection.client_id, None)

    async def _handle(self, client_id: Any, message: Any) -> None:
        browser = self._browsers.get(client_id)
        if browser is None:
            # The connection does not come from the gateway.
            return
        stamp = browser.slot.stamps.popleft()
        if self._guard.drives(message):
            try:
                actor = self._admitted(browser, message, stamp)
            except LeaseError as refusal:
                browser.slot.refuse(str(refusal))
                actor = None
            if actor is None:
                for correction in self._guard.correction(message):
                    browser.connection.queue_message(correction)
                return
            browser.actor = actor
        await self._pass_on(client_id, message)

    def _admitted(self, browser: _Browser, message: Any, stamp: Stamp) -> Actor | None:
        """Return the actor of ``message``, with its ``stamp``; None for a part of a void drag.

        Raises LeaseError with the reason for a refusal.
        """
        if isinstance(message, DRAGGING):
            held = browser.drags.get(message.name)
            if isinstance(message, wire.TransformControlsDragEndMessage):
                browser.drags.pop(message.name, None)
            # The start of the drag was refused, or a revocation ended the drag before its end.
            if held is None or not self._gate.is_current(held):
                return None
            # viser gets a late message too: the next one continues the drag, and the gate refuses
            # its command. The end of a drag is never late.
            held = replace(held, delay=stamp.delay)
            if isinstance(message, wire.TransformControlsUpdateMessage):
                try:
                    check_in_time(stamp.delay, self._gate.sample_delay)
                except LeaseError as refusal:
                    browser.slot.refuse(str(refusal))
            return held
        actor = self._hub.at_scene(browser.slot.key, *stamp)
        is_start = isinstance(message, wire.TransformControlsDragStartMessage)
        if is_start:
            check_in_time(actor.delay, self._gate.sample_delay)
        actor = self._gate.claim(actor, of_arm=self._guard.is_of_arm(message))
        if is_start:
            browser.drags[message.name] = actor
        return actor
