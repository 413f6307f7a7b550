"""What every panel is made of: controls that send commands, and are written with what is new."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import viser

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import Actor
from katana450.arm.control.state import State
from katana450.errors import KatanaError, LeaseError
from katana450.server.viser_bridge.labels import PACING

WORTH_SENDING = 2e-6
"""[deg, mm] Rounding on the way to radians and back is less."""

FINEST = 100.0
"""Parts of a degree or mm that a slider's ends are told in."""

READ_IN = 10.0
"""[s] Why something is not done goes away by itself, or the reasons would cover the scene."""

Clickable = (
    viser.GuiInputHandle[Any]
    | viser.GuiButtonHandle
    | viser.GuiButtonGroupHandle
    | viser.MeshHandle
)
"""What a person changes or clicks."""

Listen = Callable[[Clickable, Callable[[], cmd.Command]], None]
"""Sends what the function makes when a person, not this program, changes the handle."""

ORDERS: dict[str, cmd.Command] = {
    "Pause": cmd.Pause(),
    "Resume": cmd.Resume(),
}


class GestureGate(Protocol):
    """Path of a person's gestures to the arm; ``viser_bridge.gestures.Gestures`` is one."""

    def actor(self, client_id: int | None, /) -> Actor:
        """Return the giver of the gesture that viser just told of. Raises LeaseError."""
        ...

    def submit(self, command: cmd.Command, actor: Actor, /) -> int:
        """Give ``command`` to the arm; return its ticket. Raises LeaseError and InputError."""
        ...

    def is_current(self, actor: Actor, /) -> bool:
        """Return whether there was neither a stop nor a loss of the lease since ``actor`` began."""
        ...


class NoGestures:
    """A `GestureGate` that refuses everything, for a scene that drives no arm."""

    def actor(self, _client_id: int | None) -> Actor:
        raise LeaseError("This scene shows an arm and drives none.")

    def submit(self, _command: cmd.Command, _actor: Actor) -> int:
        raise LeaseError("This scene shows an arm and drives none.")

    def is_current(self, _actor: Actor) -> bool:
        return False


def listener(gestures: GestureGate) -> Listen:
    """Return one that submits commands, and shows the person why one is refused."""

    def listen(handle: Clickable, say: Callable[[], cmd.Command]) -> None:
        async def changed(event: viser.GuiEvent[Any] | viser.SceneNodePointerEvent[Any]) -> None:
            if event.client_id is None:
                return
            try:
                gestures.submit(say(), gestures.actor(event.client_id))
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
    """Tell whoever asked why it is not done, in their window."""
    if event.client is not None:
        event.client.add_notification(
            "Not done", str(error), color="red", auto_close_seconds=READ_IN
        )


def add_motion(gui: viser.GuiApi, listen: Listen, state: State) -> viser.GuiSliderHandle[float]:
    """Pause, Resume, and how fast; the slider of that."""
    orders = gui.add_button_group(
        PACING[0],
        tuple(ORDERS),
        hint="Pause: rest on the way, until Resume. STOP is above, and on Space and Esc",
    )
    listen(orders, lambda: ORDERS[orders.value])
    speed = gui.add_slider(
        PACING[1],
        min=1.0,
        max=100.0,
        step=1.0,
        initial_value=round(100.0 * state.speed),
        hint="Percent of the greatest speed, also of a motion under way",
    )
    listen(speed, lambda: cmd.SpeedScale(speed.value / 100.0))
    return speed


def ends(lower: float, upper: float) -> tuple[float, float]:
    """Of a slider between limits [deg, mm]: numbers a person can read, and never beyond them."""
    low = math.ceil(FINEST * (lower - WORTH_SENDING)) / FINEST
    return low, math.floor(FINEST * (upper + WORTH_SENDING)) / FINEST


def set_value(handle: Any, value: object) -> None:
    """Show ``value``, if it is another."""
    known = handle.value
    if (tuple(known) if isinstance(known, list | np.ndarray) else known) != value:
        handle.value = value


def set_slider(slider: viser.GuiSliderHandle[float], value: float) -> None:
    """Show ``value``, if it is another."""
    # Rounded off where nobody can see it, so that no slider shows "-0.00".
    value = min(max(round(value, 6) + 0.0, slider.min), slider.max)
    if abs(slider.value - value) > WORTH_SENDING:
        set_value(slider, value)
