"""Which of a target's six numbers count on an arm with five axes, and the nearest pose to those."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from app import tolerances
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray, frozen
from app.kinematics.arm import arm_of
from app.kinematics.branch import Branch
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.level import nearest_at_pitch
from app.kinematics.orientation import PlaneOrientation
from app.kinematics.planar import Interval
from app.kinematics.projection import Projection, planar_arms, project
from app.kinematics.turns import wrapped


class Reading(Enum):
    """What a target asks for, and what gives way when the arm cannot do all of it.

    POSE: position, then the whole orientation as near as possible in angle. PITCH: the pitch, then
    the position as near as it comes with it, then the roll. POSITION: position, then the nearest
    pitch inside the limits, then the roll. PITCH and POSITION take the yaw from the arm.
    """

    POSE = "pose"
    PITCH = "position and pitch"
    POSITION = "position"


def nearest(
    chain: Chain,
    T: npt.ArrayLike,
    reading: Reading,
    *,
    branch: Branch | None = None,
    q_hint: npt.ArrayLike | None = None,
) -> Projection:
    """The pose inside the limits nearest to `T` (4, 4) = T_S_tool [m], as `reading` has it.

    branch, q_hint and errors as of `project`, which is what POSE means. The wished pitch is that of
    the tool's x axis below the horizontal, past the vertical when it points inwards. Of the answer,
    position_error, rotation_error and yaw_error are against `T`, and pitch_error is against the
    wished pitch. A pitch that no posture on the branch has makes PITCH do as POSITION. On an arm
    with offsets every reading is POSE.
    """
    best = project(chain, T, branch=branch, q_hint=q_hint)
    if reading is Reading.POSE or not arm_of(chain).is_straight:
        return best
    T = se3.validated(T)
    theta1 = float(best.q[0])
    R = T[:3, :3] @ chain.M[:3, :3].T
    phi = _pitch(R, theta1)
    if reading is Reading.PITCH:
        held = _at_pitch(chain, T, best, phi)
        if held is not None:
            return held
    # In the arm's plane the nearest orientation is the nearest pitch and the nearest roll.
    psi = PlaneOrientation.of(R).seen_from(theta1).best_roll(phi)
    turned = so3.rotation_z(theta1) @ so3.rotation_y(phi) @ so3.rotation_x(psi)
    found = project(
        chain,
        se3.from_rotation_translation(turned @ chain.M[:3, :3], T[:3, 3]),
        branch=best.branch,
        q_hint=best.q if q_hint is None else q_hint,
    )
    return replace(
        found,
        rotation_error=so3.angle(found.T[:3, :3], T[:3, :3]),
        yaw_error=best.yaw_error,
    )


def _pitch(R: FloatArray, theta1: float) -> float:
    """Pitch [rad] of the tool axis turned to by `R` (3, 3), seen in the plane at `theta1`."""
    dx, dy, dz = R[:, 0].tolist()
    outward = math.cos(theta1) * dx + math.sin(theta1) * dy
    return math.atan2(-dz, math.copysign(math.hypot(dx, dy), outward))


def _at_pitch(chain: Chain, T: FloatArray, plane: Projection, phi: float) -> Projection | None:
    """With the pitch `phi` in the plane that `plane` found, or None where the branch lacks it."""
    theta1 = float(plane.q[0])
    x, y, z = T[:3, 3].tolist()
    u = x * math.cos(theta1) + y * math.sin(theta1)
    planar = planar_arms(chain, plane.branch)
    posture = nearest_at_pitch(planar[0], u, -z, phi) if planar else None
    if posture is None:
        return None
    wanted = PlaneOrientation.of(T[:3, :3] @ chain.M[:3, :3].T).seen_from(theta1)
    roll = Interval(float(chain.lower[4]), float(chain.upper[4]))
    psi = roll.fit(wanted.best_roll(phi))
    rolls = roll.ends if psi is None else (psi,)
    q = np.array([theta1, *posture[:3], min(rolls, key=lambda end: wanted.angle(phi, end))])
    reached = forward(chain, q)
    position_error = math.dist(reached[:3, 3], T[:3, 3])
    short = position_error > tolerances.SAME_POSITION
    at_end = np.minimum(abs(q - chain.lower), abs(q - chain.upper)) <= tolerances.LIMIT_SLACK
    may_bind = (0 in plane.limits, short, short, short, psi is None)
    return replace(
        plane,
        T=frozen(reached),
        q=frozen(q),
        position_error=position_error,
        rotation_error=so3.angle(reached[:3, :3], T[:3, :3]),
        pitch_error=abs(wrapped(posture.phi - phi)),
        limits=tuple(i for i, bound in enumerate(may_bind) if bound and at_end[i]),
        reach=short and abs(math.sin(posture.theta3)) <= tolerances.LIMIT_SLACK,
    )
