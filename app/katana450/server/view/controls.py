"""Parts of every panel: controls that send commands, and functions that update them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor
from katana450.errors import KatanaError, LeaseError

WORTH_SENDING = 2e-6
"""Smallest change [deg, mm] that is sent. The conversion to radians and back rounds by less."""

FINEST = 100.0
"""Divisions of a degree or mm to which the ends of a slider are rounded."""

READ_IN = 10.0
"""Time [s] after which the reason of a refusal closes, so that reasons do not cover the scene."""

Clickable = (
    viser.GuiInputHandle[Any]
    | viser.GuiButtonHandle
    | viser.GuiButtonGroupHandle
    | viser.MeshHandle
)
"""Handles of the controls that a person changes or clicks."""

Listen = Callable[[Clickable, Callable[[], cmd.Command]], None]
"""Sends the command that the function makes when a person changes the handle.

A change by this program sends nothing.
"""


class GestureGate(Protocol):
    """Path of a person's gestures to the arm; ``viser_bridge.gestures.Gestures`` implements it."""

    def actor(self, client_id: int | None, /) -> Actor:
        """Return the actor of the gesture that viser just reported. Raises LeaseError."""
        ...

    def submit(self, command: cmd.Command, actor: Actor, /) -> int:
        """Submit ``command`` and return its ticket. Raises LeaseError and InputError."""
        ...

    def is_current(self, actor: Actor, /) -> bool:
        """Return False if a stop or a loss of the lease has happened since ``actor`` began."""
        ...


class NoGestures:
    """A `GestureGate` that refuses everything, for a scene that only shows an arm."""

    def actor(self, _client_id: int | None) -> Actor:
        """Raise LeaseError."""
        raise LeaseError(SHOW_ONLY)

    def submit(self, _command: cmd.Command, _actor: Actor) -> int:
        """Raise LeaseError."""
        raise LeaseError(SHOW_ONLY)

    def is_current(self, _actor: Actor) -> bool:
        """Return False."""
        return False


SHOW_ONLY = "This scene only shows an arm; it cannot drive one."
"""Reason for the refusal of every gesture in a scene without an arm."""


def listener(gestures: GestureGate) -> Listen:
    """Return a function that submits commands and shows the person the reason of a refusal."""

    def listen(handle: Clickable, make: Callable[[], cmd.Command]) -> None:
        async def changed(event: viser.GuiEvent[Any] | viser.SceneNodePointerEvent[Any]) -> None:
            if event.client_id is None:
                return
            try:
                gestures.submit(make(), gestures.actor(event.client_id))
            except KatanaError as error:
                refuse(event, error)

        if isinstance(handle, viser.GuiInputHandle):
            handle.on_update(changed)
        else:
            handle.on_click(changed)

    return listen


def refuse(
    event: viser.GuiEvent[Any] | viser.SceneNodePointerEvent[Any] | viser.TransformControlsEvent,
    error: KatanaError,
) -> None:
    """Show ``error`` in the window in which ``event`` happened."""
    if event.client is not None:
        event.client.add_notification(
            "Not done", str(error), color="red", auto_close_seconds=READ_IN
        )


def ends(lower: float, upper: float) -> tuple[float, float]:
    """Return the ends of a slider between limits [deg, mm], rounded and never beyond the limits."""
    low = math.ceil(FINEST * (lower - WORTH_SENDING)) / FINEST
    return low, math.floor(FINEST * (upper + WORTH_SENDING)) / FINEST


def set_value(handle: Any, value: object) -> None:
    """Show ``value`` if it differs from the value that is shown."""
    known = handle.value
    if (tuple(known) if isinstance(known, list | np.ndarray) else known) != value:
        handle.value = value


def set_slider(slider: viser.GuiSliderHandle[float], value: float) -> None:
    """Show ``value``, clipped to the ends, if it differs from the value that is shown."""
    # No slider shows "-0.00".
    value = round(value, 6) if round(value, slider.precision or 0) else 0.0
    value = min(max(value, slider.min), slider.max)
    if abs(slider.value - value) > WORTH_SENDING:
        set_value(slider, value)
