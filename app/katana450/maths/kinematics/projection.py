"""What the arm can do with an arbitrary pose: the nearest one it can take, and what it misses.

A pose has six freedoms, the arm five: its roll axis always lies in the plane that turns with axis
1. Which of the six give way is the reading's to say. As a rule position comes first, exactly when
it can be reached, else the nearest reachable point; then the orientation, as near as possible.
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
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.canonical_target import CanonicalTarget
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.limited import LimitedArm
from katana450.maths.kinematics.nearest_posture import NearestPosture, nearest_posture
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.turns import in_limits_turn, nearest_turn, wrapped

POSITION_WORTH_TELLING: Final = 5e-5
"""[m] Half of the arm's stated precision of 0.1 mm."""

ANGLE_WORTH_TELLING: Final = math.radians(0.05)
"""[rad] Half of the last digit a person is shown."""


@dataclass(frozen=True, eq=False)
class Projection:
    """The pose the arm takes in place of an asked one, and what is lost; every figure is measured.

    T: (4, 4) that pose T_S_tool. q: (5,) the joint angles [rad] that take it, on `branch`. Both
    arrays are read-only. position_error [m] and rotation_error [rad]: between the asked pose and
    `T`. yaw_error [rad]: between the asked tool's roll axis and the arm's plane, which no five-axis
    arm can follow. pitch_error [rad]: between the two roll axes within that plane, or the two
    pitches where the reading has the pitch count and not the yaw. roll_error [rad]: the roll that
    is missing where the pitch is kept and the yaw does not count, else 0.
    What keeps the arm from coming nearer: limits: indices (from 0) of the axes whose limit does.
    axis1: axis 1 is in the way, since the branch has no place across it, or the plane passes beside
    it. reach: the links do, which reach no farther that way.
    """

    T: FloatArray
    q: FloatArray
    branch: Branch
    position_error: float
    rotation_error: float
    yaw_error: float
    pitch_error: float
    roll_error: float
    limits: tuple[int, ...]
    axis1: bool
    reach: bool


def project(
    chain: Chain,
    T: npt.ArrayLike,
    *,
    branch: Branch | None = None,
    within_limits: bool = True,
    q_hint: npt.ArrayLike | None = None,
    priority: Priority = Priority.POSE,
) -> Projection:
    """The feasible pose nearest to `T` (4, 4) = T_S_tool [m], as `priority` has it.

    branch: the branch to stay on; None takes the one that comes nearest, and of equals the one
    nearest to `q_hint` (5,) [rad]. The hint also says which limit of axis 1 to wait at,
    which way to go on facing with the tool point on axis 1, and theta1 where the pose leaves it
    free. within_limits: keep every axis inside its limits. Every valid `T` has an answer: a pitch
    that no posture has makes PITCH do as POSITION.

    Raises InputError for a `T` or `q_hint` that cannot be used, RobotDescriptionError for an arm of
    another kind.
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
    q = nearest_turn(chain, in_limits_turn(chain, q), hint)
    return measured(chain, T, canonical, found_posture, q)


def measured(
    chain: Chain,
    T: FloatArray,
    canonical: CanonicalTarget,
    found_posture: NearestPosture,
    q: FloatArray | None = None,
) -> Projection:
    """What `stance` makes of `T` (4, 4) = T_S_tool [m], which `asked` is.

    q: its joint angles (5,) [rad] where limits do not count.
    """
    arm, in_plane = arm_of(chain), found_posture.in_plane
    limits: tuple[int, ...] = ()
    if q is None:
        q = np.minimum(np.maximum(arm.joints(found_posture.alpha), chain.lower), chain.upper)
        limits = tuple(_binding(chain, q, found_posture))
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
    axis1 = position_error > tolerances.SAME_POSITION and _axis_1_binds(
        arm, canonical, found_posture
    )
    # A yaw that is given up changes the pitch that is nearest.
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
    """Whether the asked point is across axis 1 from where the branch ends, or where it cannot turn.

    A turn of axis 1 moves a tool point beside it outward or inward alone.
    """
    x, y, _ = arm.tool_point(found_posture.alpha)
    dx, dy = canonical.tool[0] - x, canonical.tool[1] - y
    c, s = math.cos(found_posture.alpha[0]), math.sin(found_posture.alpha[0])
    outward, missed_outward, missed_aside = c * x + s * y, c * dx + s * dy, c * dy - s * dx
    r = outward - arm.beside(arm.pitch(found_posture.alpha), found_posture.alpha[4])[0]
    side = 1.0 if found_posture.branch.shoulder == "front" else -1.0
    ends = abs(r) <= tolerances.ON_AXIS and side * missed_outward < -tolerances.SAME_POSITION
    beside = abs(outward) <= tolerances.ON_AXIS and abs(missed_aside) > tolerances.SAME_POSITION
    return ends or beside


def _binding(chain: Chain, q: FloatArray, found_posture: NearestPosture) -> Iterator[int]:
    held = found_posture.in_plane.posture_bound
    may_bind = (found_posture.theta1_bound, held, held, held, found_posture.in_plane.roll_bound)
    if any(may_bind):
        at_end = np.minimum(abs(q - chain.lower), abs(q - chain.upper)) <= tolerances.LIMIT_SLACK
        yield from (i for i, bound in enumerate(may_bind) if bound and at_end[i])
