"""The interface of a model of the forces in the hand. An extension provides the model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from katana450.arm.control.state import State


class GripModel(Protocol):
    """Forces between the fingers and the object that they hold. All methods are pure."""

    def overload(self, state: State) -> float | None:
        """Return the load [N] that pulls the held object out of the fingers; None if they hold."""

    def report(self, state: State) -> Mapping[str, Any]:
        """Return forces, pressures and sensor values of ``state`` for the answer to a query."""
