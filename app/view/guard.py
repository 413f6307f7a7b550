"""Nothing enters from a browser but what a browser's person can really do.

viser passes whatever a client sends to its handlers: an attribute of a control by any name, a
value outside a slider's range, a pose that is not a number. Each client message is looked at here
before viser sees it, and dropped when it is not one our page could have sent; the others notice
nothing.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from typing import Any

import viser
from viser import _messages as wire

log = logging.getLogger(__name__)

WORKSPACE = 1.5
"""[m] No gizmo goes farther from the base in any direction: more than twice the arm's reach."""

QUATERNION_SLACK = 1e-3
"""How far the length of a browser's quaternion may be from 1."""

LONGEST_TEXT = 200
"""Characters of a text field."""

TOLD = 20
"""Dropped messages that are logged one by one; a flood must not fill the log."""


class Guard:
    """Stands between viser's socket and viser's handlers."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._drags: set[tuple[Any, str]] = set()
        self.dropped = 0
        """Client messages refused since the start."""
        websocket = server._websock_server
        handle = websocket._handle_incoming_message

        async def guarded(client_id: Any, message: Any) -> None:
            objection = self._objection(client_id, message)
            if objection is None:
                await handle(client_id, message)
            else:
                self._drop(client_id, message, objection)

        websocket._handle_incoming_message = guarded  # type: ignore[method-assign]
        websocket.on_client_connect(self._greet)
        websocket.on_client_disconnect(self._forget)

    def _greet(self, connection: Any) -> None:
        """A browser's own handlers have its camera to follow and nothing else."""
        handle = connection._handle_incoming_message

        async def guarded(client_id: Any, message: Any) -> None:
            if isinstance(message, wire.ViewerCameraMessage) and self._camera(message) is None:
                await handle(client_id, message)

        connection._handle_incoming_message = guarded

    def _forget(self, connection: Any) -> None:
        self._drags = {drag for drag in self._drags if drag[0] != connection.client_id}

    def _drop(self, client_id: Any, message: Any, objection: str) -> None:
        self.dropped += 1
        if self.dropped <= TOLD:
            kind = type(message).__name__
            log.warning("Dropped a %s of browser %s: %s.", kind, client_id, objection)
        if self.dropped == TOLD:
            log.warning("More of that is dropped without a word.")

    def _objection(self, client_id: Any, message: Any) -> str | None:
        """Why ``message`` must not enter, or None when it may."""
        try:
            match message:
                case wire.ViewerCameraMessage():
                    return self._camera(message)
                case wire.GuiUpdateMessage():
                    return self._update(message)
                case wire.TransformControlsDragStartMessage():
                    self._drags.add((client_id, message.name))
                    return None
                case wire.TransformControlsUpdateMessage():
                    if (client_id, message.name) not in self._drags:
                        return "it drags what it has not taken hold of"
                    return self._gizmo(message)
                case wire.TransformControlsDragEndMessage():
                    self._drags.discard((client_id, message.name))
                    return None
                case wire.SceneNodeClickMessage():
                    return self._click(message)
        except (TypeError, ValueError, AttributeError, OverflowError) as error:
            return f"it is malformed ({error})"
        return "the page has no use for it"

    @staticmethod
    def _camera(message: wire.ViewerCameraMessage) -> str | None:
        numbers = (
            *message.wxyz, *message.position, *message.look_at, *message.up_direction,
            message.fov, message.near, message.far, message.image_height, message.image_width,
        )  # fmt: skip
        return None if _finite(numbers) else "a camera number is not finite"

    @staticmethod
    def _gizmo(message: Any) -> str | None:
        if len(message.wxyz) != 4 or len(message.position) != 3:
            return "a pose has 4 and 3 numbers"
        if not _finite((*message.wxyz, *message.position)):
            return "its pose is not finite"
        if abs(math.hypot(*message.wxyz) - 1.0) > QUATERNION_SLACK:
            return "its rotation is none"
        if max(abs(x) for x in message.position) > WORKSPACE:
            return f"its position is more than {WORKSPACE} m away"
        return None

    def _click(self, message: wire.SceneNodeClickMessage) -> str | None:
        node = self._server.scene.get_handle_by_name(message.name)
        if not getattr(node, "visible", False):
            return "there is nothing of that name to click"
        numbers = (*message.ray_origin, *message.ray_direction, *message.screen_pos)
        return None if _finite(numbers) else "a number of its ray is not finite"

    def _update(self, message: wire.GuiUpdateMessage) -> str | None:
        handle = self._server.gui._gui_input_handle_from_uuid.get(message.uuid)
        if handle is None:
            return "there is no such control"
        if set(message.updates) != {"value"}:
            return "only the value of a control can be changed"
        value = message.updates["value"]
        match handle:
            case viser.GuiButtonHandle():
                return None if isinstance(value, bool) else "a button is pressed or not"
            case viser.GuiCheckboxHandle():
                return None if isinstance(value, bool) else "a box is ticked or not"
            case viser.GuiDropdownHandle() | viser.GuiButtonGroupHandle():
                return None if value in handle.options else "that is no choice of the list"
            case viser.GuiSliderHandle() | viser.GuiNumberHandle():
                return _range([value], [handle.min], [handle.max])
            case viser.GuiVector3Handle():
                if len(value) != 3:
                    return "a vector has three numbers"
                return _range(value, handle.min or [None] * 3, handle.max or [None] * 3)
            case viser.GuiTextHandle():
                short = isinstance(value, str) and len(value) <= LONGEST_TEXT
                return None if short else "a text has at most 200 characters"
        return "that control cannot be changed"


def _finite(numbers: Iterable[Any]) -> bool:
    return all(not isinstance(x, bool | str) and math.isfinite(x) for x in numbers)


def _range(values: Iterable[Any], lows: Iterable[Any], highs: Iterable[Any]) -> str | None:
    # Browsers round to the step of a slider, which may end a hair beyond the limit.
    slack = 1e-6
    for value, low, high in zip(values, lows, highs, strict=True):
        if not _finite([value]):
            return f"{value!r} is not a finite number"
        if (low is not None and value < low - slack) or (high is not None and value > high + slack):
            return f"{value} is not between {low} and {high}"
    return None
