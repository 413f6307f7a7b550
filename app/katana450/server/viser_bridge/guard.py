"""The checks of each message of a browser before viser gets it: its size, rate, and form.

viser passes every message of a client to its handlers, even one that sets any attribute of a
control, a value outside a slider's range, or a pose that is not a number. `Guard` defines the form
of the messages that our page can send. `CommandGate` decides which participant may command.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

import msgspec
import viser
from viser import _messages as wire

from katana450.server.service.limits import TokenBucket
from katana450.server.web.security import MAX_MESSAGE_BYTES

log = logging.getLogger(__name__)

PERSONAL = ("View",)
"""Controls that affect only the window in which they are clicked."""

ARM_HANDLES = "/target/"
"""Beginning of the names of the nodes by which people drag the arm."""

WORKSPACE = 1.5
"""Maximum coordinate [m] of a gizmo in the base frame, more than twice the arm's reach."""

QUATERNION_SLACK = 1e-3
"""Maximum deviation of the length of a browser's quaternion from 1."""

MAX_TEXT_LENGTH = 200
"""Maximum number of characters in a text field."""

RATE, BURST = 150.0, 300.0
"""Maximum messages per second, and at once. viser's page sends each type at most 20 times/s."""

MAX_BAD_MESSAGES, FORGIVEN_PER_SECOND = 100.0, 1.0
"""Number of bad messages after which a connection is closed, and how many expire per second."""

NO_MESSAGE = 25.0
"""Number of bad messages for which an unreadable message counts."""

SEEN = "Seen"
"""Type of our script's message with the number of frames on the screen, which viser never gets."""

MADE = "made"
"""Field that our script adds to each message, with the time of its making [s] on the page's clock.
viser never gets it."""


class Guard:
    """Checks whether our page can have sent a message. It changes nothing."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server

    def objection(self, message: Any) -> str | None:
        """Return why our page cannot have sent ``message``, or None if it can."""
        if getattr(message, "owner", ""):
            return "it names an owner, but windows own no nodes"
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
        return "the page does not send messages of this type"

    def drives(self, message: Any) -> bool:
        """Return whether ``message`` affects more than the window that sent it."""
        if isinstance(message, wire.GuiUpdateMessage):
            return getattr(self._control(message), "label", None) not in PERSONAL
        return not isinstance(message, wire.ViewerCameraMessage)

    def is_of_arm(self, message: Any) -> bool:
        """Return whether ``message`` comes from a handle or a slider of the arm."""
        if isinstance(message, wire.GuiUpdateMessage):
            return isinstance(self._control(message), viser.GuiSliderHandle)
        return str(getattr(message, "name", "")).startswith(ARM_HANDLES)

    def correction(self, message: Any) -> list[Any]:
        """Return the messages that make the sender's window show the real state again.

        They are for a ``message`` that passed ``objection`` but was refused.
        """
        match message:
            case wire.GuiUpdateMessage():
                handle = self._control(message)
                if isinstance(handle, viser.GuiButtonHandle | viser.GuiButtonGroupHandle):
                    return []
                value = getattr(handle, "value", None)
                return [wire.GuiUpdateMessage(message.uuid, {"value": value})]
            # Not during a drag: corrections and the hand would move the handle in turn.
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
        return None if is_one else "no gizmo has that name"

    def _gizmo(self, message: Any) -> str | None:
        if len(message.wxyz) != 4 or len(message.position) != 3:
            return "its pose must have 4 numbers for rotation and 3 for position"
        if not _finite((*message.wxyz, *message.position)):
            return "its pose is not finite"
        if abs(math.hypot(*message.wxyz) - 1.0) > QUATERNION_SLACK:
            return "its quaternion does not have length 1"
        if max(abs(x) for x in message.position) > WORKSPACE:
            return f"a coordinate of its position exceeds {WORKSPACE} m"
        return self._handle(message)

    def _click(self, message: wire.SceneNodeClickMessage) -> str | None:
        if not getattr(self._node(message), "visible", False):
            return "there is no visible node of that name"
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
            case viser.GuiButtonHandle() | viser.GuiCheckboxHandle():
                return None if isinstance(value, bool) else "the value is not a boolean"
            case viser.GuiDropdownHandle() | viser.GuiButtonGroupHandle():
                return None if value in handle.options else "the value is not in the list"
            case viser.GuiSliderHandle() | viser.GuiNumberHandle():
                return _range([value], [handle.min], [handle.max])
            case viser.GuiVector3Handle():
                if len(value) != 3:
                    return "a vector must have three numbers"
                return _range(value, handle.min or [None] * 3, handle.max or [None] * 3)
            case viser.GuiTextHandle():
                short = isinstance(value, str) and len(value) <= MAX_TEXT_LENGTH
                return None if short else f"a text may have at most {MAX_TEXT_LENGTH} characters"
        return "this control cannot be changed"


def _finite(numbers: Iterable[Any]) -> bool:
    return all(not isinstance(x, bool | str) and math.isfinite(x) for x in numbers)


def _range(values: Iterable[Any], lows: Iterable[Any], highs: Iterable[Any]) -> str | None:
    # Browsers round to the step of a slider, so a value may slightly exceed a limit.
    slack = 1e-6
    for value, low, high in zip(values, lows, highs, strict=True):
        if not _finite([value]):
            return f"{value!r} is not a finite number"
        if (low is not None and value < low - slack) or (high is not None and value > high + slack):
            return f"{value} is not between {low} and {high}"
    return None


class Ruling(Enum):
    """The decision on a message. ``CLOSE`` drops it and closes the connection."""

    PASS = auto()
    DROP = auto()
    CLOSE = auto()


@dataclass(frozen=True)
class FilterResult:
    """The result for one message.

    Attributes:
        ruling: the decision.
        seen: number of frames on the screen if the message reports it.
        message: the decoded message if it passes.
        made: time of its making [s] on the clock of the page; None if it has none.
    """

    ruling: Ruling
    seen: int | None = None
    message: Any = None
    made: float | None = None


class MessageFilter:
    """The filter of one connection."""

    def __init__(self, guard: Guard, who: str, t: float) -> None:
        """Begin at ``t`` [s]; ``who`` names the sender in the log."""
        self._guard = guard
        self._who = who
        self._flood = TokenBucket(RATE, BURST, t)
        self._tolerance = TokenBucket(FORGIVEN_PER_SECOND, MAX_BAD_MESSAGES, t)

    def judge(self, data: bytes | None, t: float) -> FilterResult:
        """Return the result for a message that came at ``t`` [s]; ``data`` is None for a text."""
        if not self._flood.take(t):
            return self._drop("flood", "messages come too fast", t)
        if data is None or len(data) > MAX_MESSAGE_BYTES:
            return self._drop("none", "it is too long or not binary", t, NO_MESSAGE)
        try:
            fields = msgspec.msgpack.decode(data)
            sent = fields.pop(MADE, None)
            if sent is not None and not math.isfinite(sent):
                raise ValueError
            match fields:
                case {"type": str(kind), "count": int(count), **rest} if kind == SEEN and not rest:
                    return FilterResult(Ruling.DROP, seen=count, made=sent)
            message = wire.Message.deserialize(msgspec.msgpack.encode(fields))
        except Exception as error:
            # A message that viser's decoder rejects, by any error, is not passed to viser.
            return self._drop("none", f"it cannot be read ({type(error).__name__})", t, NO_MESSAGE)
        objection = self._guard.objection(message)
        if objection is not None:
            return self._drop(type(message).__name__, objection, t)
        return FilterResult(Ruling.PASS, message=message, made=sent)

    def _drop(self, kind: str, objection: str, t: float, weight: float = 1.0) -> FilterResult:
        log.warning("Dropped a %s of %s: %s.", kind, self._who, objection)
        tolerated = self._tolerance.take(t, weight)
        return FilterResult(Ruling.DROP if tolerated else Ruling.CLOSE)
