"""Why the goal is not what was wished: reasons with numbers, in the order a person needs them."""

from __future__ import annotations

import math

from app.control.state import Finding, Reason
from app.geometry.arrays import FloatArray
from app.kinematics.chain import Chain
from app.kinematics.projection import Projection

POSITION_WORTH_TELLING = 5e-5
"""[m] Half of the arm's stated precision of 0.1 mm."""

ANGLE_WORTH_TELLING = math.radians(0.05)
"""[rad] Half of the last digit the panel shows."""


def of_joints(chain: Chain, q: FloatArray) -> tuple[Finding, ...]:
    """What clamping ``q`` (n,) [rad] to the limits takes away."""
    findings = []
    for axis, (angle, lower, upper) in enumerate(zip(q, chain.lower, chain.upper, strict=True)):
        if angle < lower or angle > upper:
            limit = float(lower if angle < lower else upper)
            findings.append(Finding(Reason.AXIS_LIMIT, limit, axis))
    return tuple(findings)


def of_projection(chain: Chain, best: Projection, *, yaw_was_wished: bool) -> tuple[Finding, ...]:
    """What the nearest feasible pose ``best`` gives up of the wished one."""
    findings = []
    if best.position_error > POSITION_WORTH_TELLING:
        findings.append(Finding(Reason.OUT_OF_REACH, best.position_error))
    if yaw_was_wished and best.yaw_error > ANGLE_WORTH_TELLING:
        findings.append(Finding(Reason.YAW_FIXED, best.yaw_error))
    if best.position_error <= POSITION_WORTH_TELLING and best.pitch_error > ANGLE_WORTH_TELLING:
        findings.append(Finding(Reason.PITCH_CHANGED, best.pitch_error))
    if findings or best.rotation_error > ANGLE_WORTH_TELLING:
        for axis in best.limits:
            q, lower, upper = best.q[axis], chain.lower[axis], chain.upper[axis]
            findings.append(
                Finding(Reason.AXIS_LIMIT, float(min(lower, upper, key=lambda b: abs(b - q))), axis)
            )
    return tuple(findings)
