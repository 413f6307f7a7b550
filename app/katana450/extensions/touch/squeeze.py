"""An object that two fingers squeeze: its place between them, and the forces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.extensions.touch.pad import (
    STIFFNESS,
    THICKNESS,
    Pad,
    PadPressure,
    pressed,
    pressure_at,
)
from katana450.extensions.touch.solid_body import SolidBody
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen

FORCE_LIMIT = 10.0
"""[N] Greatest force of a finger, as the current of its motor allows. Assumed: the 0.5 N m that the
robot description states for a finger, at the 50 mm from its pivot to the middle of its pad."""

REACH = 1.5 * THICKNESS
"""[m] Distance from the object up to which a point of a pad can come into it by squeezing."""

MAX_GAP = 2e-3
"""[m] Gap to both pads up to which the fingers have stopped because the pads touch: half of
TOUCH_DISTANCE and CENTRING_DISTANCE of the grip, and some more."""

CENTRING_STEPS, BALANCE_STEPS, SEARCH_STEPS = 4, 8, 16
"""Greatest numbers of steps of the searches."""

MAX_SQUEEZE = 0.25
"""[rad] Squeeze beyond which the pads have no more to yield: they are THICKNESS deep everywhere."""

MARGIN = 1e-3
"""[m] Distance from the object up to which a point counts as near, at more than the greatest force.
"""

FIRST_SQUEEZE, GROWTH = 0.02, 2.0
"""[rad, 1] Start of the search for a force, and the growth of its steps."""

POWER = 2.0 / 3.0
"""[1] Power of the force that grows about as the squeeze does."""

FORCE_TOLERANCE = 1e-4
"""[N] Difference of two forces that count as equal."""


@dataclass(frozen=True, eq=False)
class Squeeze:
    """An object under the forces of two fingers.

    Attributes:
        pads: the pressures on both pads.
        axis: (3,) unit direction in the frame of the palm along which the fingers close.
    """

    pads: tuple[PadPressure, PadPressure]
    axis: FloatArray

    @property
    def force(self) -> float:
        """The greater of the forces of the fingers [N]."""
        return max(pad.force for pad in self.pads)

    @property
    def normal_force(self) -> float:
        """The sum of the normal forces on both pads [N], which friction is proportional to."""
        return sum(pad.force for pad in self.pads)


class _Points(NamedTuple):
    """The points of one pad that can come into the object, with their numbers in the pad."""

    numbers: npt.NDArray[np.intp]
    points: FloatArray
    normals: FloatArray
    areas: FloatArray

    def only(self, selection: npt.NDArray[np.bool_]) -> _Points:
        """Return those of the points for which ``selection`` (n,) is true."""
        numbers, points, normals, areas = self
        return _Points(numbers[selection], points[selection], normals[selection], areas[selection])


class SqueezedBody:
    """An object between two fingers that stopped when they touched it.

    It is free along the direction in which the fingers close, so it lies where both press with the
    same force. Depth counts from where the fingers stopped.

    Attributes:
        axis: (3,) unit direction in the frame of the palm along which the fingers close.
        on_pads: whether the pads of both fingers touch it. Elsewhere no forces are known.
    """

    def __init__(
        self,
        pads: tuple[Pad, Pad],
        body: SolidBody,
        T_palm_body: FloatArray,
        fingers: Callable[[float], tuple[FloatArray, FloatArray]],
        grip: float,
        force_limit: float = FORCE_LIMIT,
    ) -> None:
        """Place the object between the fingers.

        Args:
            pads: the pads of both fingers.
            body: the object.
            T_palm_body: (4, 4) pose of its middle in the palm.
            fingers: returns the poses (4, 4) of both fingers in the palm for a finger joint [rad].
            grip: finger joint at which the fingers stopped [rad].
            force_limit: greatest force of a finger [N].
        """
        self._pads, self._body, self._fingers, self._grip = pads, body, fingers, grip
        self._T_body_palm = se3.inverse(T_palm_body)
        near, far = (
            T[:3, :3] @ pad.points.mean(axis=0) + T[:3, 3]
            for pad, T in zip(pads, fingers(grip), strict=True)
        )
        self.axis = frozen((far - near) / np.linalg.norm(far - near))
        self._along = self._T_body_palm[:3, :3] @ self.axis
        self._near = [self._reachable(pad, T) for pad, T in zip(pads, fingers(grip), strict=True)]
        self._gap = self._shift = 0.0
        self._greatest = MAX_SQUEEZE
        self.on_pads = all(len(group.points) > 0 for group in self._near)
        if self.on_pads:
            self._shift, self._gap = self._centred()
            self.on_pads = self._gap <= MAX_GAP
        if self.on_pads:
            self._greatest, self._shift = self._squeeze_at(force_limit, forget=True)

    def squeezed(self, squeeze: float) -> Squeeze:
        """Return the object under ``squeeze`` [rad], or the part that the force limit allows."""
        if not self.on_pads:
            none = np.zeros(0)
            first, second = (pressed(pad, none, none.astype(np.intp)) for pad in self._pads)
            return Squeeze((first, second), self.axis)
        depths = self._forces(min(squeeze, self._greatest), self._shift)[2]
        first, second = (
            pressed(pad, depth, near.numbers)
            for pad, near, depth in zip(self._pads, self._near, depths, strict=True)
        )
        return Squeeze((first, second), self.axis)

    def _reachable(self, pad: Pad, T_palm_finger: FloatArray) -> _Points:
        T = self._T_body_palm @ T_palm_finger
        numbers = np.flatnonzero(self._body.depth(pad.points @ T[:3, :3].T + T[:3, 3]) > -REACH)
        # The normals are needed only along the closing direction, so their turn is neglected.
        normals = pad.normals[numbers] @ T[:3, :3].T
        return _Points(numbers, pad.points[numbers], normals, pad.areas[numbers])

    def _depths(self, squeeze: float, shift: float) -> list[FloatArray]:
        """Return the depth of the near points of each pad [m], with the object moved by ``shift``.

        ``shift``: along the closing direction, from the first pad to the second [m].
        """
        depths = []
        for near, T_palm_finger in zip(
            self._near, self._fingers(self._grip - squeeze), strict=True
        ):
            T = self._T_body_palm @ T_palm_finger
            points = near.points @ T[:3, :3].T + (T[:3, 3] - shift * self._along)
            depths.append(self._body.depth(points) + self._gap)
        return depths

    def _centred(self) -> tuple[float, float]:
        """Return the shift [m] with the same gap to both fingers where they stopped, and the gap.

        The gap is negative if they stopped inside the object, as after rounding.
        """
        shift = gap = 0.0
        for _ in range(CENTRING_STEPS):
            first, second = (-float(depth.max()) for depth in self._depths(0.0, shift))
            shift += 0.5 * (second - first)
            gap = 0.5 * (first + second)
        return shift, gap

    def _forces(self, squeeze: float, shift: float) -> tuple[float, float, list[FloatArray]]:
        """Return the greater force of a finger [N], the shift [m] at which both are equal, depths.

        The depths [m] are those of the near points of each pad.
        """
        depths = self._depths(squeeze, shift)
        for step in range(BALANCE_STEPS):
            if step:
                depths = self._depths(squeeze, shift)
            greatest = total = stiffness = 0.0
            for near, depth in zip(self._near, depths, strict=True):
                forces = pressure_at(depth) * near.areas
                closing = near.normals @ self._along
                greatest = max(greatest, float(forces.sum()))
                total += float(forces @ closing)
                inside = (depth > 0.0) & (depth < THICKNESS)
                stiffness += STIFFNESS * float(near.areas[inside] @ closing[inside] ** 2)
            if abs(total) <= FORCE_TOLERANCE or stiffness <= 0.0:
                break
            shift += total / stiffness
        return greatest, shift, depths

    def _squeeze_at(self, wanted: float, *, forget: bool = False) -> tuple[float, float]:
        """Return the squeeze [rad] with the force ``wanted`` [N], and the shift there [m].

        ``forget``: whether to drop the points that more than this force does not bring near.
        """
        low, low_force, shift = 0.0, 0.0, self._shift
        high = min(FIRST_SQUEEZE, self._greatest)
        while True:
            high_force, shift, depths = self._forces(high, shift)
            if high_force >= wanted or high >= self._greatest:
                break
            low, low_force, high = high, high_force, min(GROWTH * high, self._greatest)
        if forget:
            # With less force the pads touch less of it.
            pairs = zip(self._near, depths, strict=True)
            self._near = [near.only(depth > -MARGIN) for near, depth in pairs]
        if high_force <= wanted:
            return high, shift
        for _ in range(SEARCH_STEPS):
            # A round contact grows as the power 3/2, so this power of the force is nearly a line.
            below, above, between = (newtons**POWER for newtons in (low_force, high_force, wanted))
            middle = low + (high - low) * (between - below) / (above - below)
            force, shift, _ = self._forces(middle, shift)
            if abs(force - wanted) <= FORCE_TOLERANCE:
                return middle, shift
            if force > wanted:
                high, high_force = middle, force
            else:
                low, low_force = middle, force
        return low, shift
