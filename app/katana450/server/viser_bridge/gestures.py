"""Gestures at viser's handles, panels and ghosts: mapped to actors, and admitted or refused.

viser stores the new value of a control and sends it to the other browsers before it calls any
callback. So `CommandGate` is asked first: a refused gesture never reaches viser, and the window it
came from springs back. The callback's command then goes through `CommandGate.submit`, which
decides.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import viser
from viser import _messages as wire

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import Actor
from katana450.errors import LeaseError
from katana450.server.service.hub import Hub
from katana450.server.viser_bridge.frames import FrameSlot, slot_of
from katana450.server.viser_bridge.guard import Guard

DRAGGING = (wire.TransformControlsUpdateMessage, wire.TransformControlsDragEndMessage)


@dataclass
class _Browser:
    """One browser's connection at viser's end.

    Attributes:
        connection: viser's own, for messages to this browser alone.
        slot: the passage to the gateway's end.
        drags: giver of each drag under way, by the name of the handle.
        actor: giver of the newest gesture.
    """

    connection: Any
    slot: FrameSlot
    drags: dict[str, Actor] = field(default_factory=dict)
    actor: Actor | None = None


class Gestures:
    """Maps viser's browsers to actors. Lives in viser's event loop.

    The hook is no public interface of viser's: its version is exact, and tests with raw sockets
    hold it.
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
        # After viser's own, which still ends the drags of a browser that is gone.
        websocket.on_client_disconnect(self._part)
        self._websocket = websocket

    def actor(self, client_id: int | None) -> Actor:
        """Return the giver of the gesture that viser just told of.

        ``client_id``: of viser's event. Call it before the callback awaits anything. Raises
        LeaseError where no gesture of that browser was let through.
        """
        browser = None if client_id is None else self._browsers.get(client_id)
        if browser is None or browser.actor is None:
            raise LeaseError("Open the front page to drive the arm.")
        return browser.actor

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
            # Not from the gateway.
            return
        seen = browser.slot.stamps.popleft()
        if self._guard.drives(message):
            try:
                actor = self._admitted(browser, message, seen)
            except LeaseError as refusal:
                browser.slot.refuse(str(refusal))
                actor = None
            if actor is None:
                for correction in self._guard.correction(message):
                    browser.connection.queue_message(correction)
                return
            browser.actor = actor
        await self._pass_on(client_id, message)

    def _admitted(self, browser: _Browser, message: Any, seen: int) -> Actor | None:
        """Return the giver of ``message``; None for a part of a drag that is void.

        Raises LeaseError with the reason for a refusal.
        """
        if isinstance(message, DRAGGING):
            held = browser.drags.get(message.name)
            if isinstance(message, wire.TransformControlsDragEndMessage):
                browser.drags.pop(message.name, None)
            # Its beginning was refused, or it was ended here while the hand went on.
            return None if held is None or not self._gate.is_current(held) else held
        actor = self._hub.at_scene(browser.slot.key, seen)
        runner = self._hub.runner
        if self._guard.is_of(message, runner.controls):
            # A run may be another's than who drives by hand.
            self._gate.check_current(actor)
            runner.check_may_touch(actor)
            return actor
        actor = self._gate.claim(actor, pacing=self._guard.paces(message))
        if isinstance(message, wire.TransformControlsDragStartMessage):
            browser.drags[message.name] = actor
        return actor
