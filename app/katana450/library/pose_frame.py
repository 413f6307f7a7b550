"""The frame in which a program gives and receives poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.pose import pose_matrix

NAMES = ("shoulder", "base")


def dimensions(value: npt.ArrayLike) -> int:
    """Return the number of dimensions of ``value``; 0 if it is not a regular array."""
    try:
        return np.ndim(value)
    except ValueError:
        return 0


@dataclass(frozen=True, eq=False)
class PoseFrame:
    """One of two frames: "shoulder", the paper's {S}, or "base", the root link of the URDF.

    Attributes:
        name: name of the frame.
        T_frame_shoulder: (4, 4) maps coordinates in {S} into the frame [m].
    """

    name: str
    T_frame_shoulder: FloatArray

    @staticmethod
    def of(T_base_shoulder: FloatArray, name: str) -> PoseFrame:
        """Return the frame with that ``name``; ``T_base_shoulder`` (4, 4) is {S} in the base [m].

        Raises InputError for an unknown name.
        """
        if name not in NAMES:
            raise InputError(f"There is no frame {name!r}; choose from {', '.join(NAMES)}.")
        return PoseFrame(name, frozen(np.eye(4)) if name == "shoulder" else T_base_shoulder)

    @property
    def in_base(self) -> bool:
        """True for the base frame."""
        return self.name == "base"

    def from_shoulder(self, T: FloatArray) -> FloatArray:
        """Return poses ``T`` (..., 4, 4) in {S} as poses in this frame [m]."""
        return self.T_frame_shoulder @ T if self.in_base else T

    def twists_from_shoulder(self, V: FloatArray) -> FloatArray:
        """Return twists (omega, v), the columns of ``V`` (6, n) in {S}, as twists in this frame."""
        return se3.adjoint(self.T_frame_shoulder) @ V if self.in_base else V

    @cached_property
    def _T_shoulder_frame(self) -> FloatArray:
        return frozen(se3.inverse(self.T_frame_shoulder))

    def to_shoulder(self, T: npt.ArrayLike) -> npt.ArrayLike:
        """Return a pose in this frame as the pose (4, 4) in {S} [m], or poses as (N, 4, 4).

        The forms of a pose are those of `pose_matrix`. Any other value is returned unchanged; the
        kinematics refuse it with the reason.
        """
        if type(T) is not np.ndarray:
            T = pose_matrix(T)
        if not self.in_base or dimensions(T) < 2:
            return T
        array = np.asarray(T)
        if array.shape[-2:] != (4, 4) or array.dtype.kind not in "iuf":
            return T
        if array.ndim == 2:
            # For one pose `dot` takes half the time of `@`.
            pose: FloatArray = self._T_shoulder_frame.dot(array)
            return pose
        return np.asarray(self._T_shoulder_frame @ array)
