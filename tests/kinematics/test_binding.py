"""The reported constraints are exactly the binding ones."""

from __future__ import annotations

import dataclasses
import math
import os

import numpy as np
import pytest

from katana450.arm.control.state.messages import PRIORITIES
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection, project
from katana450.maths.kinematics.tool import pitch_and_roll
from tests.kinematics.conftest import katana
from tests.kinematics.family import Offsets, limited_member, member

CASES = 1000 if os.environ.get("KATANA450_LONG") else 25

SAME = 1e-7
"""A smaller gain [m], [rad] by a wider limit is rounding."""


CHAINS = {
    "katana": katana(),
    "member": limited_member(np.random.default_rng(1), lateral=False),
    "lateral member": limited_member(np.random.default_rng(2), lateral=True),
}


def widened(chain: Chain, axes: FloatArray, by: float) -> Chain:
    return dataclasses.replace(chain, lower=chain.lower - by * axes, upper=chain.upper + by * axes)


def random_target(chain: Chain, rng: np.random.Generator) -> FloatArray:
    """Return a target: anywhere, far away, near axis 1, near limits, or feasible but turned."""
    arm = arm_of(chain)
    kind = rng.integers(5)
    if kind >= 3:
        q = rng.uniform(chain.lower, chain.upper)
        if kind == 3:
            q = np.where(rng.random(5) < 0.7, rng.choice((chain.lower, chain.upper)), q)
        T = np.array(forward(chain, q))
        T[:3, :3] = T[:3, :3] @ so3.exp(rng.normal(scale=0.3, size=3))
        T[:3, 3] += rng.normal(scale=0.02, size=3)
        return T
    position = rng.normal(size=3) * arm.reach * (0.4, 5.0, 0.4)[kind]
    if kind == 2:
        position[:2] *= 10.0 ** rng.uniform(-6.0, 0.0)
    T_C = se3.from_rotation_translation(so3.exp(2.0 * rng.normal(size=3)), position)
    return se3.inverse(arm.T_C_S) @ T_C


def misses(p: Projection, priority: Priority) -> tuple[float, ...]:
    """Return the errors in order of priority; a pitch that no posture has counts as POSITION."""
    if priority is Priority.POSE:
        return p.position_error, p.rotation_error
    if priority is Priority.PITCH and p.pitch_error <= SAME:
        return p.pitch_error, p.position_error
    return p.position_error, p.pitch_error


def gained(before: tuple[float, ...], after: tuple[float, ...], least: float) -> int:
    """Return 1 if `after` is nearer, -1 if it is farther, by more than `least`; else 0."""
    for miss, miss_after in zip(before, after, strict=True):
        if abs(miss - miss_after) > least:
            return 1 if miss_after < miss else -1
    return 0


@pytest.mark.parametrize("priority", PRIORITIES)
@pytest.mark.parametrize("name", CHAINS)
def test_reported_limits_are_exactly_the_binding_ones(name: str, priority: Priority) -> None:
    chain, rng = CHAINS[name], np.random.default_rng(7)
    limited = idle = 0
    for _ in range(CASES):
        T = random_target(chain, rng)
        p = project(chain, T, priority=priority)
        missed = misses(p, priority)
        named = np.zeros(5)
        named[list(p.limits)] = 1.0

        other = project(widened(chain, 1.0 - named, 1e-4), T, priority=priority, branch=p.branch)  # type: ignore[arg-type]
        assert gained(missed, misses(other, priority), SAME) <= 0
        if max(missed) > SAME and (priority is not Priority.POSE or p.yaw_error <= SAME):
            assert p.limits or p.axis1 or p.reach
        pitched = priority is not Priority.PITCH or p.pitch_error <= SAME
        if p.position_error > SAME and pitched and not p.limits:
            free = project(chain, T, priority=priority, branch=p.branch, within_limits=False)  # type: ignore[arg-type]
            # With the pitch kept, a limit may keep the tool from facing the other way.
            (one, _), (two, _) = (pitch_and_roll(chain, near.q) for near in (p, free))
            faces_alike = abs(math.remainder(one - two, math.tau)) <= SAME
            if priority is not Priority.PITCH or faces_alike:
                assert gained(missed, misses(free, priority), SAME) <= 0

        # The roll counts least and depends on its own limit alone.
        named[4] *= priority is Priority.POSE
        if named.any() and not p.axis1:
            wide = project(widened(chain, named, 1e-3), T, priority=priority, branch=p.branch)  # type: ignore[arg-type]
            gain = gained(missed, misses(wide, priority), 1e-10)
            assert gain >= 0
            limited += 1
            idle += gain == 0
    assert limited > 0.3 * CASES
    # Near axis 1 a turn of it gains almost nothing.
    assert idle <= 0.01 * limited


@pytest.mark.parametrize("priority", PRIORITIES)
def test_the_limit_of_the_roll_is_named_where_it_binds(priority: Priority) -> None:
    chain, rng = CHAINS["katana"], np.random.default_rng(8)
    named = 0
    roll = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    for _ in range(CASES):
        T = random_target(chain, rng)
        p = project(chain, T, priority=priority)
        wide = project(widened(chain, roll, 1e-3), T, priority=priority, branch=p.branch)  # type: ignore[arg-type]
        beyond = not chain.lower[4] - 1e-9 <= wide.q[4] <= chain.upper[4] + 1e-9
        # A roll that is lost beside a pitch that gives way is not missed.
        beyond = beyond and (priority is Priority.POSE or p.pitch_error <= SAME)
        assert (4 in p.limits) == beyond
        named += beyond
    # With the pitch kept the tool faces the other way instead.
    assert named > 0 or priority is Priority.PITCH


def test_axis_1_is_named_where_the_branch_ends_on_it() -> None:
    """The target is behind the arm, and axis 1 cannot turn so far."""
    limits = np.array([0.8, 2.3, 2.3, 2.3, 0.8])
    chain = dataclasses.replace(katana(), lower=-limits, upper=limits)
    T = se3.from_rotation_translation(np.eye(3), [-0.2, 0.01, 0.3])
    for elbow in ("up", "down"):
        p = project(chain, T, branch=Branch("front", elbow))
        assert p.axis1
        assert math.hypot(*p.T[:2, 3]) < 1e-9
        across = project(chain, T, branch=Branch("back", elbow))
        assert not across.axis1
        assert across.position_error < 1e-9


def test_axis_1_is_named_where_the_plane_passes_beside_it() -> None:
    offsets = Offsets(0.03, 0.05, (0.2, 0.2, 0.15), (0.0, 0.0, 0.0), 0.0, (1, 1, 1, 1, 1))
    chain = member(offsets, np.eye(4), np.eye(4))
    for rho, inside in ((0.02, True), (0.06, False)):
        T = se3.from_rotation_translation(np.eye(3), [rho, 0.0, 0.25])
        for priority in Priority:
            p = project(chain, T, priority=priority)
            assert p.axis1 == inside
            assert not p.reach
            assert (p.position_error > 1e-3) == inside
