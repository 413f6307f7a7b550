"""The nearest pose without a hint: no hint leads nearer, and every angle of axis 1 is used."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from katana450.arm.control.state.messages import PRIORITIES
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection, project
from tests.conftest import LONG
from tests.kinematics.brute_force import least_rotation, postures_at
from tests.kinematics.targets import targets

ROUNDING = 1e-8

BESIDE_THE_GAP = se3.validated(
    [
        [-0.0559, -0.1403, -0.9885, -0.5313],
        [-0.2657, -0.9523, 0.1502, 0.0546],
        [-0.9624, 0.2711, 0.0159, -0.3267],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
"""A pose behind the arm, in the gap of axis 1."""


def misses(p: Projection, priority: Priority) -> tuple[float, ...]:
    """Return the errors of ``p`` in the order of the priority."""
    match priority:
        case Priority.POSE:
            return p.position_error, p.rotation_error
        case Priority.POSITION:
            return p.position_error, p.pitch_error
    return p.pitch_error, float(p.roll_error > ROUNDING), p.position_error


def beaten(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Return True if ``b`` is smaller than ``a``, in order."""
    for x, y in zip(a, b, strict=True):
        if abs(x - y) > ROUNDING:
            return y < x
    return False


def with_hints(chain: Chain, T: FloatArray, priority: Priority) -> list[Projection]:
    hints = (None, chain.lower, chain.upper, np.zeros(5))
    return [
        project(chain, T, priority=priority, branch=branch, q_hint=hint)
        for branch in BRANCHES
        for hint in hints
    ]


@pytest.mark.parametrize("priority", [Priority.POSE, Priority.POSITION])
def test_no_hint_and_no_branch_is_better(chain: Chain, priority: Priority) -> None:
    for T in targets(chain, np.random.default_rng(3), 15 if LONG else 5):
        errors = misses(project(chain, T, priority=priority), priority)
        for other in with_hints(chain, T, priority):
            assert not beaten(errors, misses(other, priority)), T.tolist()


@pytest.mark.parametrize("priority", PRIORITIES)
def test_pose_in_the_gap_of_axis_1_is_approached_from_the_better_side(
    chain: Chain, priority: Priority
) -> None:
    errors = misses(project(chain, BESIDE_THE_GAP, priority=priority), priority)
    for other in with_hints(chain, BESIDE_THE_GAP, priority):
        assert not beaten(errors, misses(other, priority))


def test_every_theta1_is_used_where_the_nearest_point_is_on_axis_1(chain: Chain) -> None:
    # The postures are in corners of the limits, which a grid meets only with a tolerance.
    slack, checked = 3e-3, 0
    wide = dataclasses.replace(chain, lower=chain.lower - slack, upper=chain.upper + slack)
    theta1s = np.linspace(chain.lower[0], chain.upper[0], 60)
    for T in targets(chain, np.random.default_rng(11), 20 if LONG else 8):
        for branch in BRANCHES:
            p = project(chain, T, branch=branch)
            if math.hypot(*p.T[:2, 3]) > 1e-9 or p.position_error < 1e-6:
                continue
            on_axis = np.array((0.0, 0.0, p.T[2, 3]))
            either = [side for side in BRANCHES if side.elbow == branch.elbow]
            # Every plane has the same postures there.
            q = postures_at(wide, on_axis, [0.0], 6001, either)
            q = np.repeat(q[np.abs(q[:, 0]) < 1e-9], len(theta1s), axis=0)
            q[:, 0] = np.resize(theta1s, len(q))
            least = least_rotation(wide, T, q)
            assert p.rotation_error <= least + 20.0 * slack
            checked += least < math.pi
    assert checked > (5 if LONG else 1)
