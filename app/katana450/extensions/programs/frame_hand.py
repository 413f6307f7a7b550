"""The part that hands share which grasp by the frame of their fingers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Final

import numpy as np

from katana450.arm.control.scene_objects import SceneObject
from katana450.extensions.programs.approach import ABOVE, DOWN, FRONT, YAW_TOLERANCE, Approach
from katana450.extensions.programs.fitting import JAW_ROOM, Widths, fitting, widths
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.tool import DragTarget

TIP_DISTANCES: Final = tuple(np.arange(0.0, 0.056, 0.002).tolist())
"""[m] Distances of the hand before the middle of a low object, tried from the smallest."""


class FrameHand(ABC):
    """A part of `HandPlanning` for a hand with a grasp frame.

    Attributes:
        T_tool_grasp: (4, 4) pose of the grasp frame in that of the tool [m].
        opening: distance between the open fingers [m].
        one_jaw: whether one jaw closes against a fixed one.
        pitches: pitches of the hand for a grasp from the front [rad], tried in this order.
    """

    T_tool_grasp: FloatArray
    opening: float
    one_jaw: bool

    pitches: ClassVar[Sequence[float]]
    tool: ClassVar[str] = ""
    tip_distances: ClassVar[Sequence[float]] = TIP_DISTANCES

    def approaches(
        self, scene_object: SceneObject, at: FloatArray, side: FloatArray
    ) -> Mapping[str, Sequence[Approach]]:
        """Return the approaches between whose fingers the object fits."""
        return self._fitting(self.pitches, scene_object, at, side)

    def with_pitch(
        self, pitch: float, scene_object: SceneObject, at: FloatArray, side: FloatArray
    ) -> Sequence[Approach]:
        """Return the approaches with ``pitch``."""
        found = self._fitting((pitch,), scene_object, at, side)
        return found.get(ABOVE if abs(pitch - DOWN) <= YAW_TOLERANCE else FRONT, ())

    def drawn_back(self, q: FloatArray, away: float) -> DragTarget:
        """Return the tool, drawn back along the x axis of the grasp frame."""
        at = self._at(q)
        return at.moved(frozen(at.position - away * self._R(q)[:, 0]))

    def retreat(self, q: FloatArray, away: float) -> DragTarget:
        """Return the tool, drawn back by ``away`` [m] and, for a fixed jaw, moved by JAW_ROOM.

        It moves along -y of the grasp frame, so that this jaw leaves the object.
        """
        back = self.drawn_back(q, away)
        aside = JAW_ROOM * self._R(q)[:, 1]
        return back.moved(frozen(back.position - aside)) if self.one_jaw else back

    def _fitting(
        self, pitches: Sequence[float], scene_object: SceneObject, at: FloatArray, side: FloatArray
    ) -> Mapping[str, Sequence[Approach]]:
        """Return all approaches between whose fingers the object fits, or raise InputError."""
        options = self._options(pitches, scene_object, at, side)
        return fitting(options, self.opening, one_jaw=self.one_jaw)

    def _options(
        self, pitches: Sequence[float], scene_object: SceneObject, at: FloatArray, side: FloatArray
    ) -> Widths:
        """Return approaches by side, each with the width [m] of the object between the fingers."""
        return widths(pitches, scene_object, at, side)

    @abstractmethod
    def _at(self, q: FloatArray) -> DragTarget:
        """Return the target of the tool at `q` (n,) [rad]."""

    @abstractmethod
    def _R(self, q: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) of the grasp frame in {S} at `q` (n,) [rad]."""
