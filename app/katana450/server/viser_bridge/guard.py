"""Nothing enters from a browser but what a browser's person can really do.

viser passes whatever a client sends to its handlers: an attribute of a control by any name, a
value outside a slider's range, a pose that is not a number. Here is what a client message must be
so that our page could have sent it; the gateway asks before viser sees any.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import viser
from viser import _messages as wire

from katana450.server.viser_bridge.labels import PACING, PERSONAL

WORKSPACE = 1.5
"""[m] No gizmo goes farther from the base in any direction: more than twice the arm's reach."""

QUATERNION_SLACK = 1e-3
"""How far the length of a browser's quaternion may be from 1."""

MAX_TEXT_LENGTH = 200
"""Characters of a text field."""


class Guard:
    """Tells what our page can have sent from what it cannot. Changes nothing."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server

    def objection(self, message: Any) -> str | None:
        """Why no page of ours can have sent ``message``, or None when one can."""
        if getattr(message, "owner", ""):
            return "no window owns a part of the scene"
        try:
            match message:
                case wire.ViewerCameraMessage():
                    return self._camera(message)
                case wire.GuiUpdateMessage():
                    return self._update(message)
                case wire.TransformControlsUpdateMessage():
                    return self._gizmo(message)
                case (
                    wire.TransformControlsDragStartMessage()
                    | wire.TransformControlsDragEndMessage()
                ):
                    return self._handle(message)
                case wire.SceneNodeClickMessage():
                    return self._click(message)
        except (TypeError, ValueError, AttributeError, OverflowError) as error:
            return f"it is malformed ({error})"
        return "the page has no use for it"

    def drives(self, message: Any) -> bool:
        """Whether ``message`` reaches beyond the window it comes from."""
        if isinstance(message, wire.GuiUpdateMessage):
            return getattr(self._control(message), "label", None) not in PERSONAL
        return not isinstance(message, wire.ViewerCameraMessage)

    def paces(self, message: Any) -> bool:
        """Whether ``message`` only pauses, resumes or slows down what moves, by hand or program."""
        return self.is_of(message, PACING)

    def is_of(self, message: Any, labels: tuple[str, ...]) -> bool:
        """Return whether ``message`` is for a control with one of ``labels``."""
        if not isinstance(message, wire.GuiUpdateMessage):
            return False
        return getattr(self._control(message), "label", None) in labels

    def correction(self, message: Any) -> list[Any]:
        """What the sender must be told so that its window shows the truth again.

        For a ``message`` that passed ``objection`` and yet did not enter.
        """
        match message:
            case wire.GuiUpdateMessage():
                handle = self._control(message)
                if isinstance(handle, viser.GuiButtonHandle | viser.GuiButtonGroupHandle):
                    return []
                value = getattr(handle, "value", None)
                return [wire.GuiUpdateMessage(message.uuid, {"value": value})]
            # Not in mid-drag: hand and truth would wrestle for the handle.
            case wire.TransformControlsDragEndMessage():
                node = self._node(message)
                w, x, y, z = map(float, node.wxyz)
                px, py, pz = map(float, node.position)
                return [
                    wire.SetOrientationMessage(message.name, (w, x, y, z)),
                    wire.SetPositionMessage(message.name, (px, py, pz)),
                ]
        return []

    def _control(self, message: wire.GuiUpdateMessage) -> Any:
        return self._server.gui._gui_input_handle_from_uuid.get(message.uuid)

    def _node(self, message: Any) -> Any:
        return self._server.scene.get_handle_by_name(message.name)

    @staticmethod
    def _camera(message: wire.ViewerCameraMessage) -> str | None:
        numbers = (
            *message.wxyz, *message.position, *message.look_at, *message.up_direction,
            message.fov, message.near, message.far, message.image_height, message.image_width,
        )  # fmt: skip
        return None if _finite(numbers) else "a camera number is not finite"

    def _handle(self, message: Any) -> str | None:
        is_one = isinstance(self._node(message), viser.TransformControlsHandle)
        return None if is_one else "there is nothing of that name to drag"

    def _gizmo(self, message: Any) -> str | None:
        if len(message.wxyz) != 4 or len(message.position) != 3:
            return "a pose has 4 and 3 numbers"
        if not _finite((*message.wxyz, *message.position)):
            return "its pose is not finite"
        if abs(math.hypot(*message.wxyz) - 1.0) > QUATERNION_SLACK:
            return "its rotation is none"
        if max(abs(x) for x in message.position) > WORKSPACE:
            return f"its position is more than {WORKSPACE} m away"
        return self._handle(message)

    def _click(self, message: wire.SceneNodeClickMessage) -> str | None:
        if not getattr(self._node(message), "visible", False):
            return "there is nothing of that name to click"
        numbers = (*message.ray_origin, *message.ray_direction, *message.screen_pos)
        return None if _finite(numbers) else "a number of its ray is not finite"

    def _update(self, message: wire.GuiUpdateMessage) -> str | None:
        handle = self._control(message)
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
            case viser.GuiRgbHandle():
                if len(value) != 3:
                    return "a colour has three numbers"
                return _range(value, [0] * 3, [255] * 3)
            case viser.GuiVector3Handle():
                if len(value) != 3:
                    return "a vector has three numbers"
                return _range(value, handle.min or [None] * 3, handle.max or [None] * 3)
            case viser.GuiTextHandle():
                short = isinstance(value, str) and len(value) <= MAX_TEXT_LENGTH
                return None if short else f"a text has at most {MAX_TEXT_LENGTH} characters"
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
