"""A grip on a gizmo: the mouse holds one handle and moves it by metres or radians."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tests.browser.page import Axis, Pixel, ViserPage

Array = NDArray[np.floating[Any]]


class Grip(ABC):
    """A context manager that presses the mouse on a handle and releases it at the end.

    Raises AssertionError if two presses do not start a drag.
    """

    KIND: ClassVar[str]

    def __init__(self, page: ViserPage, node: str, axis: Axis) -> None:
        self._page = page
        self._mouse = page.page.mouse
        self._node = node
        self._axis = axis
        self._value = 0.0
        self._locate()

    def _locate(self) -> None:
        """Find where the press meets the handle, and the handle's pose, in three.js's world."""
        self._pixel, self._hit, matrix = self._page.handle(self._node, self.KIND, self._axis)
        self._origin = matrix[:3, 3]
        self._axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)

    @abstractmethod
    def _point_at(self, value: float) -> Array:
        """Return the point (3,) of three.js's world to which the mouse must point for the value."""

    def pixels(self, value: float) -> tuple[Pixel, Pixel]:
        """Return where a finger is put down for a drag to ``value``, and where it is lifted."""
        return self._pixel, self._page.project_three(self._point_at(value))

    def to(self, value: float) -> None:
        """Move the handle to a value relative to the start of the grip."""
        self._mouse.move(*self._page.project_three(self._point_at(value)))
        self._value = value

    def sweep(self, value: float, steps: int) -> None:
        """Move the handle to a value in equal steps from its present one."""
        for step in np.linspace(self._value, value, steps + 1)[1:]:
            self.to(float(step))

    def __enter__(self) -> Self:
        try:
            self._press()
        except AssertionError:
            # The scene has moved between the look and the press. A person tries again.
            self._locate()
            self._press()
        return self

    def _press(self) -> None:
        started = self._count("Start")
        self._mouse.move(*self._pixel)
        self._mouse.down()
        try:
            self._page.wait_until(
                lambda: self._count("Start") > started, f"a drag of {self._node} to start"
            )
        except BaseException:
            self._mouse.up()
            raise

    def __exit__(self, _kind: object, error: object, _trace: object) -> None:
        ended = self._count("End")
        self._mouse.up()
        if error is None:
            # A page that has lost its server drops the message.
            self._page.wait_until(
                lambda: self._count("End") > ended or not self._page.connected,
                f"the drag of {self._node} to end",
            )

    def _count(self, phase: str) -> int:
        sent = self._page.sent(f"TransformControlsDrag{phase}Message")
        return sum(message.body["name"] == self._node for message in sent)


class ArrowGrip(Grip):
    """A grip on an arrow, which lies along y of its own frame; values are in metres."""

    KIND = "arrow"

    def _point_at(self, value: float) -> Array:
        # drei moves the control by the point of this line that is nearest to the mouse's ray.
        point: Array = self._hit + value * self._axes[:, 1]
        return point


class RingGrip(Grip):
    """A grip on a ring in the x-y plane of its own frame; values are radians about z."""

    KIND = "ring"

    def _point_at(self, value: float) -> Array:
        # drei measures the angle in the ring's plane from the pressed point.
        x, y, _ = self._axes.T @ (self._hit - self._origin)
        angle = math.atan2(y, x) + value
        in_plane = np.array([math.cos(angle), math.sin(angle), 0.0]) * math.hypot(x, y)
        point: Array = self._origin + self._axes @ in_plane
        return point
