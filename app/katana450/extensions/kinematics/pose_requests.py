"""Poses in requests of ``katana450 ik``: a matrix, or a point with one of four orientations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from katana450.errors import InputError
from katana450.extensions.kinematics.numbers import numbers
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.pose_units import check_metres, check_radians
from katana450.maths.kinematics.projection import project
from katana450.maths.kinematics.tool import ToolTarget

MAX_QUATERNION_MISFIT = 1e-3
"""Maximum deviation of the length of a quaternion from 1: that of one printed with 3 decimals."""

QUATERNIONS = {"wxyz": (0, 1, 2, 3), "xyzw": (3, 0, 1, 2)}
"""Keys of quaternions, and the places of w, x, y and z in them."""

KEYS = frozenset({"T", "p", "rpy", "pitch", "roll", *QUATERNIONS})
"""The keys that describe a pose."""


class RequestedPose(NamedTuple):
    """The pose ``T`` (4, 4) of the tool in {S} [m], and how far its numbers are from a rotation."""

    T: FloatArray
    misfit: float


def requested_pose(
    request: Mapping[str, Any], chain: Chain, T_frame_shoulder: FloatArray
) -> RequestedPose:
    """Return the pose in ``request``, whose numbers are in the frame of ``T_frame_shoulder``.

    The forms are ``T``, or ``p`` with ``wxyz``, ``xyzw``, ``rpy`` or with ``pitch`` and ``roll``.
    Pitch and roll are those of the arm's plane, so they have no yaw: of the planes of both
    shoulders the one that comes nearer is taken. Raises InputError with the key at fault, also for
    numbers that seem to be millimetres or degrees.
    """
    pose = _requested(request, chain, T_frame_shoulder)
    check_metres(chain, pose.T[:3, 3].tolist())
    return pose


def _requested(
    request: Mapping[str, Any], chain: Chain, T_frame_shoulder: FloatArray
) -> RequestedPose:
    given = [key for key in ("T", *QUATERNIONS, "rpy", "pitch", "roll") if key in request]
    if given == ["T"] and "p" not in request:
        T = numbers(request, "T", 2)
        pose = se3.validated(T, "T")
        misfit = so3.misfit(np.array(T)[:3, :3])
        return RequestedPose(se3.inverse(T_frame_shoulder) @ pose, misfit)
    if not given and "p" not in request:
        raise InputError("The key 'T' is missing, or 'p' with an orientation.")
    if given not in (["wxyz"], ["xyzw"], ["rpy"], ["pitch", "roll"]) or "p" not in request:
        raise InputError(
            "A pose is T, or p with one orientation: wxyz, xyzw, rpy, or both pitch and roll; "
            f"this has {', '.join(sorted(KEYS & set(request)))}."
        )
    p = finite_array(numbers(request, "p", 1), (3,), "p")
    if given == ["pitch", "roll"]:
        pitch, roll = (float(numbers(request, key, 0)) for key in given)
        if not (math.isfinite(pitch) and math.isfinite(roll)):
            raise InputError("pitch and roll must be finite numbers.")
        check_radians((pitch, roll), "The pose")
        position = (se3.inverse(T_frame_shoulder) @ np.append(p, 1.0))[:3]
        target = ToolTarget(position, pitch, roll)
        poses = [target.pose(chain, target.facing(chain, each, 0.0)) for each in BRANCHES[::2]]
        return RequestedPose(min(poses, key=lambda T: _misses(chain, T)), 0.0)
    R, misfit = _rotation(request, given[0])
    T = se3.from_rotation_translation(R, p)
    return RequestedPose(se3.inverse(T_frame_shoulder) @ T, misfit)


def _misses(chain: Chain, T: FloatArray) -> tuple[float, float]:
    """Return how far [m], [rad] the arm is from ``T`` (4, 4) without limits, rounded to compare."""
    nearest = project(chain, T, within_limits=False)
    return round(nearest.position_error, 9), round(nearest.rotation_error, 9)


def _rotation(request: Mapping[str, Any], key: str) -> tuple[FloatArray, float]:
    """Return the rotation (3, 3) of ``key``, and the deviation of a quaternion from length 1."""
    if key == "rpy":
        roll, pitch, yaw = finite_array(numbers(request, key, 1), (3,), key).tolist()
        check_radians((roll, pitch, yaw), key)
        return so3.from_rpy(roll, pitch, yaw), 0.0
    q = finite_array(numbers(request, key, 1), (4,), key)
    length = math.hypot(*q.tolist())
    misfit = abs(length - 1.0)
    if misfit > MAX_QUATERNION_MISFIT:
        raise InputError(
            f"{key} has the length {length:.4g}, but a rotation has the length 1 "
            f"(allowed: {MAX_QUATERNION_MISFIT:g} off)."
        )
    return so3.from_quaternion(q[list(QUATERNIONS[key])]), misfit
