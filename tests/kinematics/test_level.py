"""The nearest tool point at a fixed pitch, against a search without geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.nearest_posture import nearest_at_pitch
from katana450.maths.kinematics.planar import Interval, PlanarArm, Posture
from tests.kinematics.conftest import L1, L2, TOOL_LENGTHS

L3 = TOOL_LENGTHS["tcp"]
LOWER, UPPER = np.radians([-124.25, -117.70, -116.50]), np.radians([7.75, 127.30, 107.50])


def planar(elbow: str, side: int) -> PlanarArm:
    theta2, theta3, theta4 = (Interval(*ends) for ends in zip(LOWER, UPPER, strict=True))
    sign = 1 if elbow == "up" else -1
    bend = Interval(0.0, theta3.upper) if elbow == "up" else Interval(theta3.lower, 0.0)
    return PlanarArm(L1, L2, L3, theta2, bend, theta4, sign, 0.0, side)


def least_gap(arm: PlanarArm, u: float, v: float, phi: float) -> float:
    """Return the minimum distance [m] over a grid of (theta2, theta3), refined round the best."""
    centers, widths = np.array([[0.0, 0.0]]), np.array([4.5, 4.5])
    best = math.inf
    for _ in range(9):
        a, b = np.meshgrid(*(np.linspace(-1.0, 1.0, 41) * width for width in widths))
        grid = (centers[:, None, :] + np.stack((a.ravel(), b.ravel()), axis=1)).reshape(-1, 2)
        # The finer grids must also contain the edges.
        theta2 = np.clip(grid[:, 0], arm.theta2.lower, arm.theta2.upper)
        theta3 = np.clip(grid[:, 1], arm.theta3.lower, arm.theta3.upper)
        gaps = gap(arm, u, v, phi, theta2, theta3)
        order = np.argsort(gaps)[:20]
        best = min(best, float(gaps[order[0]]))
        centers = np.stack((theta2, theta3), axis=1)[order]
        widths = widths * 0.3
    return best


def gap(
    arm: PlanarArm, u: float, v: float, phi: float, theta2: FloatArray, theta3: FloatArray
) -> FloatArray:
    theta4 = phi - theta2 - theta3
    turned = np.arctan2(np.sin(theta4), np.cos(theta4))
    pu = L1 * np.cos(theta2) + L2 * np.cos(theta2 + theta3) + L3 * math.cos(phi)
    pv = L1 * np.sin(theta2) + L2 * np.sin(theta2 + theta3) + L3 * math.sin(phi)
    allowed = (turned >= arm.theta4.lower) & (turned <= arm.theta4.upper) & (pu * arm.side >= 0.0)
    return np.where(allowed, np.hypot(pu - u, pv - v), np.inf)


@pytest.mark.cases(2)
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("elbow", ["up", "down"])
def test_found_posture_is_the_nearest(elbow: str, side: int, rng: np.random.Generator) -> None:
    arm, number = planar(elbow, side), 0
    for _ in range(25):
        u, v = rng.uniform(-0.8, 0.8, size=2)
        phi = float(rng.uniform(-math.pi, math.pi))
        posture = nearest_at_pitch(arm, u, v, phi)
        least = least_gap(arm, u, v, phi)
        if posture is None:
            assert least == math.inf
            continue
        number += 1
        pu, pv = arm.tool(posture)
        assert math.remainder(posture.phi - phi, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert pu * side >= -1e-12
        for angle, ends in zip(posture[:3], (arm.theta2, arm.theta3, arm.theta4), strict=True):
            assert ends.lower <= angle <= ends.upper
        # The pitch is feasible, so the search may miss the optimum but not beat it.
        assert math.hypot(pu - u, pv - v) <= least + 1e-9
    assert number > 8


def test_reachable_point_is_reached(rng: np.random.Generator) -> None:
    arm, reached = planar("up", 1), 0
    for _ in range(200):
        q = rng.uniform((LOWER[0], 0.0, LOWER[2]), UPPER)
        desired = Posture(*q.tolist())
        u, v = arm.tool(desired)
        if u < 0.0:
            continue
        reached += 1
        posture = nearest_at_pitch(arm, u, v, desired.phi)
        assert posture is not None
        assert np.allclose(posture[:3], q, atol=1e-6)
        assert np.allclose(arm.tool(posture), (u, v), atol=1e-12)
    assert reached > 80


def test_infeasible_pitch_is_refused() -> None:
    arm = PlanarArm(
        L1, L2, L3, Interval(-0.1, 0.1), Interval(0.0, 0.2), Interval(-0.1, 0.1), 1, 0.0, 1
    )
    assert nearest_at_pitch(arm, 0.4, 0.0, 2.0) is None
    assert nearest_at_pitch(arm, 0.4, 0.0, 0.3) is not None
