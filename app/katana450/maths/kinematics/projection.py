"""Projection of an arbitrary pose: the nearest pose that the arm can take, and its errors.

A pose has six freedoms, the arm has five: its roll axis always lies in the plane that turns with
axis 1. The priority chooses which freedom gives way. As a rule position comes first: exact if it
can be reached, else the nearest reachable point. Then comes the orientation, as near as possible.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import FiveAxisArm, arm_of
from katana450.maths.kinematics.branch import AnyBranch, Branch
from katana450.maths.kinematics.canonical_target import CanonicalTarget
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.nearest_posture import NearestPosture, nearest_posture
from katana450.maths.kinematics.planar import LimitedArm
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.turns import in_limits_turns, nearest_turn, wrapped

POSITION_WORTH_TELLING: Final = 5e-5
"""Smallest position error [m] that is reported: half of the arm's stated precision of 0.1 mm."""

ANGLE_WORTH_TELLING: Final = math.radians(0.05)
"""Smallest angle error [rad] that is reported: half of the last displayed digit."""


@dataclass(frozen=True, eq=False)
class Projection:
    """The pose that the arm takes in place of a target pose; every error is measured.

    Arrays are read-only.

    Attributes:
        T: the pose T_S_tool (4, 4) of the arm.
        q: the joint angles (n,) [rad] that take it.
        branch: the branch of `q`.
        position_error, rotation_error: difference [m], [rad] between the target pose and `T`.
        yaw_error: angle [rad] between the target's roll axis and the arm's plane, which no
            five-axis arm can follow.
        pitch_error: angle [rad] between the two roll axes within that plane, or between the two
            pitches if the priority keeps the pitch and not the yaw.
        roll_error: roll [rad] that is missing where the pitch is kept and the yaw does not count,
            else 0.
        limits: indices (from 0) of the axes whose limit keeps the arm from coming nearer.
        axis1: True if axis 1 does so: the branch ends there, or the plane passes beside it.
        reach: True if the length of the links does so.
    """

    T: FloatArray
    q: FloatArray
    branch: AnyBranch
    position_error: float
    rotation_error: float
    yaw_error: float = 0.0
    pitch_error: float = 0.0
    roll_error: float = 0.0
    limits: tuple[int, ...] = ()
    axis1: bool = False
    reach: bool = False


def project(
    chain: Chain,
    T: npt.ArrayLike,
    *,
    branch: Branch | None = None,
    within_limits: bool = True,
    q_hint: npt.ArrayLike | None = None,
    priority: Priority = Priority.POSE,
) -> Projection:
    """Return the feasible pose nearest to `T` (4, 4) = T_S_tool [m], by `priority`.

    Every valid `T` has an answer: for a pitch that no posture has, PITCH acts as POSITION.

    Args:
        chain: the arm.
        T: target pose (4, 4).
        branch: the branch to stay on. None takes the nearest one, and of equal ones the one nearest
            to `q_hint`.
        within_limits: keep every axis inside its limits.
        q_hint: joint angles (5,) [rad]. They also choose the limit of axis 1 to wait at, the
            direction to face with the tool point on axis 1, and theta1 where the pose leaves it
            free.
        priority: the part of the target that is kept.

    Raises:
        InputError: `T` or `q_hint` is invalid.
        RobotDescriptionError: the arm is outside the family.
    """
    hint = None if q_hint is None else chain.check_q(q_hint)
    limited = LimitedArm.of(chain, within_limits=within_limits)
    arm = limited.arm
    T = se3.validated(T)
    x, y, z = (arm.T_C_S[:3, :3] @ T[:3, 3] + arm.T_C_S[:3, 3]).tolist()
    canonical = CanonicalTarget.pose(arm.pose(T), (x, y, z), priority)
    found_posture = nearest_posture(
        limited, canonical, branch, None if hint is None else arm.angles(hint)
    )
    q = arm.joints(found_posture.alpha)
    if within_limits:
        return measured(chain, T, canonical, found_posture)
    q = nearest_turn(chain, in_limits_turns(chain, q), hint)
    return measured(chain, T, canonical, found_posture, q)


def measured(
    chain: Chain,
    T: FloatArray,
    canonical: CanonicalTarget,
    found_posture: NearestPosture,
    q: FloatArray | None = None,
) -> Projection:
    """Return the projection that `found_posture` gives for `T` (4, 4) = T_S_tool [m].

    `canonical` is the same target. `q` (5,) [rad] are the joint angles if limits do not count.
    """
    arm, in_plane = arm_of(chain), found_posture.in_plane
    limited = q is None
    if q is None:
        q = np.minimum(np.maximum(arm.joints(found_posture.alpha), chain.lower), chain.upper)
    reached = forward(chain, q)
    position_error = math.dist(reached[:3, 3], T[:3, 3])
    theta1 = found_posture.alpha[0]
    outward, sideways, down = canonical.heading(theta1)
    flat = math.hypot(outward, down)
    yaw_error, pitch_error = math.atan2(abs(sideways), flat), 0.0
    if canonical.priority is not Priority.POSE or flat > tolerances.ON_AXIS:
        pitch = arm.pitch(found_posture.alpha)
        pitch_error = abs(wrapped(pitch - canonical.pitch(theta1)))
        if canonical.priority is Priority.PITCH and canonical.along is not None:
            turned = math.pi - canonical.pitch(theta1)
            pitch_error = min(pitch_error, abs(wrapped(pitch - turned)))
    pitch_kept = canonical.priority is not Priority.POSE and pitch_error <= tolerances.SAME_ROTATION
    # Roll that is lost beside a pitch that gives way is not missed.
    roll_counts = canonical.priority is Priority.POSE or pitch_kept
    limits = tuple(_binding(chain, q, found_posture, roll_counts)) if limited else ()
    axis1 = position_error > tolerances.SAME_POSITION and _axis_1_binds(
        arm, canonical, found_posture
    )
    # A missing yaw changes the pitch that is nearest.
    pitched = canonical.priority is not Priority.POSE or yaw_error <= tolerances.SAME_ROTATION
    missed = max(position_error, pitch_error if pitched else 0.0) > tolerances.SAME_POSITION
    return Projection(
        T=frozen(reached),
        q=frozen(q),
        branch=found_posture.branch,
        position_error=position_error,
        rotation_error=so3.angle(reached[:3, :3], T[:3, :3]),
        yaw_error=yaw_error,
        pitch_error=pitch_error,
        roll_error=in_plane.rotation_error if pitch_kept else 0.0,
        limits=limits,
        axis1=axis1,
        reach=(in_plane.posture_bound and in_plane.posture.stretched)
        or (missed and not limits and not axis1),
    )


def _axis_1_binds(
    arm: FiveAxisArm, canonical: CanonicalTarget, found_posture: NearestPosture
) -> bool:
    """Return True if axis 1 keeps the tool point from coming nearer to the target point.

    Either the branch ends at axis 1 and the target is across it, or turning about axis 1 does not
    help: it moves a tool point beside the axis only outward or inward.
    """
    x, y, _ = arm.tool_point(found_posture.alpha)
    dx, dy = canonical.tool[0] - x, canonical.tool[1] - y
    c, s = math.cos(found_posture.alpha[0]), math.sin(found_posture.alpha[0])
    outward, missed_outward, missed_aside = c * x + s * y, c * dx + s * dy, c * dy - s * dx
    r = outward - arm.beside(arm.pitch(found_posture.alpha), found_posture.alpha[4])[0]
    side = 1.0 if found_posture.branch.shoulder == "front" else -1.0
    ends = abs(r) <= tolerances.ON_AXIS and side * missed_outward < -tolerances.SAME_POSITION
    is_aside = abs(outward) <= tolerances.ON_AXIS and abs(missed_aside) > tolerances.SAME_POSITION
    return ends or is_aside


def _binding(
    chain: Chain, q: FloatArray, found_posture: NearestPosture, roll_counts: bool
) -> Iterator[int]:
    """Yield the indices (from 0) of the axes whose limit binds."""
    held, rolled = found_posture.in_plane.posture_bound, found_posture.in_plane.roll_bound
    may_bind = (found_posture.theta1_bound, held, held, held, rolled and roll_counts)
    if any(may_bind):
        at_end = np.minimum(abs(q - chain.lower), abs(q - chain.upper)) <= tolerances.LIMIT_SLACK
        yield from (i for i, bound in enumerate(may_bind) if bound and at_end[i])
