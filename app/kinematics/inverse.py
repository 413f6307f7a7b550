"""Inverse kinematics in closed form: every joint vector that puts the tool at a pose.

The paper's eq. (12) to (29), each angle by a subproblem: theta1 by 4 on the tool point, theta3 by 3
on the wrist, theta2, theta4 and theta5 by 1. The wrist, not the tool point, is what axes 2 and 3
carry, and both shoulders and both elbows are followed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.geometry import se3, so3
from app.geometry.arrays import FloatArray
from app.geometry.vectors import Vector, add, dot, norm, rotate, scale, sub, vector
from app.kinematics.arm import Axis, FiveAxisArm, arm_of
from app.kinematics.branch import BRANCHES, Branch
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.subproblems import subproblem1, subproblem3, subproblem4, wrapped

_ORIGIN: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Solution:
    """One answer of `inverse`.

    q: (5,) joint angles [rad], read-only. branch: how the arm stands. within_limits: whether q is
    inside the chain's limits. position_error [m], rotation_error [rad]: what forward kinematics of
    q misses the asked pose by.
    """

    q: FloatArray
    branch: Branch
    within_limits: bool
    position_error: float
    rotation_error: float


@dataclass(frozen=True, slots=True)
class _Target:
    """What the subproblems need of G = T M^-1, which moves the arm from home to T."""

    tool: Vector
    wrist: Vector
    side: Vector
    along: Vector


def inverse(
    chain: Chain, T: npt.ArrayLike, *, q_hint: npt.ArrayLike | None = None
) -> tuple[Solution, ...]:
    """The four solutions for the pose `T` (4, 4) = T_S_tool [m], in the order of BRANCHES.

    Two coincide where their branches meet (arm stretched or folded, tool point on axis 1). `T`
    should be a pose the five axes can do; of any other the least-squares angles come back and the
    errors say by how much they miss. Angles are in the turn that fits the limits when one does,
    else in (-pi, pi]. With tool point and tool both along axis 1 theta1 is free: it is then that of
    `q_hint` (5,), or 0.

    Raises InputError for a `T` or `q_hint` that cannot be used, RobotDescriptionError for an arm of
    another kind. Source: the paper's eq. (12)-(29).
    """
    arm = arm_of(chain)
    T = se3.validated(T)
    free_theta1 = 0.0 if q_hint is None else float(chain.check_q(q_hint)[0])
    target = _target(arm, T @ se3.inverse(chain.M))
    solutions: list[Solution] = []
    for theta1 in _shoulders(arm, target, free_theta1):
        for theta2, theta3 in _elbows(arm, target, theta1):
            q = _wrist(arm, target, theta1, theta2, theta3)
            branch = BRANCHES[len(solutions)]
            solutions.append(_measured(chain, np.array(q), branch, T))
    return tuple(solutions)


def in_limits_turn(chain: Chain, q: FloatArray) -> FloatArray:
    """`q` (n,) [rad], each angle in the turn inside its limits if there is one, else wrapped."""
    result = np.array([wrapped(theta) for theta in q])
    for turn in (-math.tau, math.tau):
        outside = (result < chain.lower) | (result > chain.upper)
        other = result + turn
        fits = outside & (other >= chain.lower) & (other <= chain.upper)
        result = np.where(fits, other, result)
    return result


def _target(arm: FiveAxisArm, G: FloatArray) -> _Target:
    R, p = G[:3, :3], G[:3, 3]
    four, five = arm.axes[3], arm.axes[4]
    return _Target(
        tool=vector(R @ arm.tool + p),
        wrist=vector(R @ arm.wrist + p),
        side=vector(R @ four.omega),
        along=vector(R @ five.omega),
    )


def _back(axis: Axis, theta: float, p: Vector) -> Vector:
    """exp(axis theta)^-1 p."""
    return rotate(p, axis.omega, axis.r, -theta)


def _shoulders(arm: FiveAxisArm, target: _Target, free_theta1: float) -> tuple[float, float]:
    """theta1 facing the tool point, and with the back to it.

    The arm's plane holds axis 1 and is square to axis 2: turning back by theta1 takes the tool
    point into it. On axis 1 that says nothing, but the tool's direction must lie in the plane too.
    """
    one, two = arm.axes[0], arm.axes[1]
    backwards = scale(-1.0, one.omega)
    offset = dot(two.omega, two.r)
    seen = target.tool
    turns = subproblem4(backwards, one.r, seen, two.omega, offset)
    if turns.free:
        seen = target.along
        turns = subproblem4(backwards, _ORIGIN, seen, two.omega, 0.0)
    if turns.free:
        return free_theta1, wrapped(free_theta1 + math.pi)
    theta = turns.angles[0]
    other = turns.angles[-1]
    faces = dot(rotate(seen, one.omega, _ORIGIN, -theta), arm.axes[4].omega) >= 0.0
    return (theta, other) if faces else (other, theta)


def _elbows(arm: FiveAxisArm, target: _Target, theta1: float) -> tuple[tuple[float, float], ...]:
    """(theta2, theta3) with the elbow up, and down."""
    one, two, three = arm.axes[:3]
    q0 = _back(one, theta1, target.wrist)
    bends = subproblem3(three.omega, three.r, arm.wrist, two.r, norm(sub(q0, two.r)))
    result = []
    for theta3 in (max(bends.angles), min(bends.angles)):
        p1 = rotate(arm.wrist, three.omega, three.r, theta3)
        result.append((subproblem1(two.omega, two.r, p1, q0).angles[0], theta3))
    return tuple(result)


def _wrist(
    arm: FiveAxisArm, target: _Target, theta1: float, theta2: float, theta3: float
) -> tuple[float, float, float, float, float]:
    """All five angles: theta4 turns the tool point into place, theta5 a point beside the wrist."""
    one, two, three, four, five = arm.axes

    def before_wrist(p: Vector) -> Vector:
        return _back(three, theta3, _back(two, theta2, _back(one, theta1, p)))

    theta4 = subproblem1(four.omega, four.r, arm.tool, before_wrist(target.tool)).angles[0]
    beside = before_wrist(add(target.wrist, target.side))
    beside = _back(four, theta4, beside)
    home = add(arm.wrist, four.omega)
    theta5 = subproblem1(five.omega, five.r, home, beside).angles[0]
    return theta1, theta2, theta3, theta4, theta5


def _measured(chain: Chain, q: FloatArray, branch: Branch, T: FloatArray) -> Solution:
    q = in_limits_turn(chain, q)
    q.setflags(write=False)
    reached = forward(chain, q)
    return Solution(
        q=q,
        branch=branch,
        within_limits=chain.within_limits(q),
        position_error=math.dist(reached[:3, 3], T[:3, 3]),
        rotation_error=so3.angle(reached[:3, :3], T[:3, :3]),
    )
