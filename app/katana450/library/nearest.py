"""Projection of a pose onto the feasible poses, with the reason for the remaining error."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy.typing as npt

from katana450.arm.control.findings import of_projection
from katana450.arm.control.messages import REASONS
from katana450.errors import InputError
from katana450.library.pose_frame import PoseFrame
from katana450.maths.geometry import se3
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.pose_units import check_metres
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection, project

PRIORITIES = {"pose": Priority.POSE, "pitch": Priority.PITCH, "position": Priority.POSITION}


@dataclass(frozen=True, eq=False)
class NearestPose(Projection):
    """The feasible pose nearest to the target, and the remaining errors; all of them are measured.

    Attributes:
        T: (4, 4) the feasible pose, in the frame of the arm object [m].
        q: (n,) joint angles that take it [rad].
        branch: the branch of ``q``.
        position_error: distance from the target [m].
        rotation_error: angle from the target [rad].
        yaw_error: angle between the target's roll axis and the arm's plane, which a 5-axis arm
            cannot leave [rad].
        pitch_error: angle between the two roll axes within that plane [rad].
        roll_error: missing roll where the pitch has priority [rad].
        limits: indices, from 0, of the axes whose limit keeps the arm from coming nearer.
        axis1: whether axis 1 keeps the arm from coming nearer.
        reach: whether the links are too short to come nearer.
        reason: the same in words; empty if the target is met within the precision of the arm.
    """

    reason: str


def nearest(
    chain: Chain,
    frame: PoseFrame,
    T: npt.ArrayLike,
    *,
    priority: str,
    branch: Branch | str | None,
    q_hint: npt.ArrayLike | None,
    within_limits: bool,
) -> NearestPose:
    """Project the pose ``T`` (4, 4) of ``frame``; see `katana450.Arm.nearest`."""
    if priority not in PRIORITIES:
        known = ", ".join(PRIORITIES)
        raise InputError(f"There is no priority {priority!r}; choose from {known}.")
    chosen, pose = PRIORITIES[priority], se3.validated(frame.to_shoulder(T))
    check_metres(chain, pose[:3, 3].tolist())
    best = project(
        chain,
        pose,
        branch=None if branch is None else Branch.parse(str(branch)),
        within_limits=within_limits,
        q_hint=q_hint,
        priority=chosen,
    )
    findings = of_projection(chain, best, chosen, yaw_was_given=chosen is Priority.POSE)
    reason = "; ".join(REASONS[finding.reason](finding) for finding in findings)
    best = replace(best, T=frame.from_shoulder(best.T))
    return NearestPose(
        **{each.name: getattr(best, each.name) for each in fields(best)}, reason=reason
    )
