"""The interfaces of models of the hand, which extensions provide."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from katana450.arm.control.scene_objects import SceneObject
    from katana450.arm.control.state import State
    from katana450.maths.collision.world import CollisionWorld


class GripModel(Protocol):
    """Forces between the fingers and the object that they hold. All methods are pure."""

    def overload(self, state: State) -> float | None:
        """Return the load [N] under which the held object slides; None if the fingers hold it."""

    def slid(self, state: State, dt: float) -> SceneObject | None:
        """Return the held object after it has slid for ``dt`` [s]; None if it leaves the fingers.

        ``state`` has an overload.
        """

    def report(self, state: State) -> Mapping[str, Any]:
        """Return forces, pressures and sensor values of ``state`` for the answer to a query."""


class FixedJawModel(Protocol):
    """A fixed jaw, against which the moving jaw pushes objects. Its method is pure."""

    def met(
        self, world: CollisionWorld, state: State, item: SceneObject
    ) -> tuple[str, float, SceneObject | None]:
        """Return the name of the fixed jaw, its distance [m] from ``item``, and the pushed object.

        ``item`` touches the moving jaw. The pushed object is in the base frame, nearer to the fixed
        jaw. It is None if it touches the jaw already, is not before its face, or cannot be pushed:
        uphill, or into another object.
        """
