"""``katana450 fk`` and ``ik`` for arms that are not of the five-axis family."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from katana450.errors import InputError
from katana450.extensions.general_arms.described_arm import DescribedArm
from katana450.extensions.general_arms.nearest import nearest_posture
from katana450.extensions.kinematics.numbers import numbers, shown
from katana450.extensions.kinematics.pose_requests import KEYS, requested_pose
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.solution import Solution

GENERAL_KEYS = KEYS - {"pitch", "roll"}
"""The keys that describe a pose of any arm; pitch and roll are those of five axes."""


class GeneralLines:
    """Forward and inverse kinematics of an arm of any kind, on plain JSON values."""

    def __init__(self, arm: DescribedArm, *, in_base_frame: bool, with_nearest: bool) -> None:
        """Answer for ``arm``.

        Args:
            arm: the arm.
            in_base_frame: whether poses are in the base frame, else in {S}.
            with_nearest: whether answers include the nearest posture inside the limits.
        """
        self._arm = arm
        self._with_nearest = with_nearest
        self._T_frame_shoulder = arm.T_base_shoulder if in_base_frame else np.eye(4)

    def fk(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer ``{"q": [n rad], "tool"}`` with ``{"T": 4x4}`` [m]."""
        chain = self._kinematics(request, frozenset({"q"})).chain
        q = chain.check_q(numbers(request, "q", 1))
        return {"T": (self._T_frame_shoulder @ forward(chain, q)).tolist()}

    def ik(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer a pose with the solutions of all branches, as ``JsonKinematics.ik``.

        ``"q"`` [n rad] decides what the pose leaves free. If no branch takes the pose, the one that
        comes nearest without regard to limits is the only solution. ``singular`` are the axes,
        counted from 1, that can turn together there without moving the tool.
        """
        kinematics = self._kinematics(request, GENERAL_KEYS | {"q"})
        chain = kinematics.chain
        hint = chain.check_q(numbers(request, "q", 1)) if "q" in request else None
        T, misfit = requested_pose(request, chain, self._T_frame_shoulder)
        found = kinematics.inverse(T, hint)
        exact = [each for each in found if each.exact] or [min(found, key=_errors)]
        answer = {
            "solutions": [_solution(each) for each in exact],
            "residual_mm": 1e3 * max(each.position_error for each in exact),
            "residual_rad": max(each.rotation_error for each in exact),
            "rotation_misfit": misfit,
        }
        return answer | (self._nearest(kinematics, T, hint) if self._with_nearest else {})

    @staticmethod
    def _nearest(kinematics: Kinematics, T: FloatArray, hint: FloatArray | None) -> dict[str, Any]:
        best = nearest_posture(kinematics, T, q_hint=hint)
        return {
            "nearest": {
                "q": best.q.tolist(),
                "branch": best.branch,
                "position_mm": 1e3 * best.position_error,
                "rotation_rad": best.rotation_error,
                "limits": [axis + 1 for axis in best.limits],
                "reason": best.reason,
            }
        }

    def _kinematics(self, request: Mapping[str, Any], keys: frozenset[str]) -> Kinematics:
        known = keys | {"tool"}
        unknown = set(request) - known
        if unknown:
            raise InputError(f"There is no key {sorted(unknown)[0]!r}; known: {sorted(known)}.")
        tool = request.get("tool", self._arm.default_tool)
        if not isinstance(tool, str):
            raise InputError(f"'tool' is {shown(tool)}; there is no tool with that name.")
        return self._arm.kinematics_to(tool)


def _errors(posture: Solution) -> tuple[float, float]:
    return round(posture.position_error, 9), posture.rotation_error


def _solution(posture: Solution) -> dict[str, Any]:
    return {
        "q": posture.q.tolist(),
        "within_limits": posture.within_limits,
        "branch": str(posture.branch),
        "singular": [axis + 1 for axis in posture.singular],
    }
