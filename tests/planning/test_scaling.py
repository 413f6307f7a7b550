"""Time along a path: every limit holds for any allowed tau(t), and little time is lost."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruckig import InputParameter, Ruckig, Trajectory

from katana450.arm.control.arm import ArmModel
from katana450.errors import InputError
from katana450.extensions.programs.planning.curve_path import ToolPath
from katana450.extensions.programs.planning.curves import ToolLines
from katana450.maths.planning.pacing import SampledPath, fastest
from katana450.maths.planning.path import Path, joint_derivatives, point_derivatives
from katana450.maths.planning.scaling import Bounds, Scaling, motion_after, rest_to_rest
from tests.planning.time_optimal import least_time

NAMES = ("circle", "line", "pour", "lines", "joints", "via")


@pytest.fixture(scope="module")
def scalings(paths: dict[str, Path], bounds: Bounds) -> dict[str, Scaling]:
    return {name: fastest(path, bounds) for name, path in paths.items()}


def loads(path: Path, scaling: Scaling, bounds: Bounds) -> np.ndarray:
    """Return the maximum ratios (5,) of the loads to their limits.

    The loads are speed, acceleration, jerk, tool speed and tool acceleration: the maximum for any
    tau(t) within its bounds, at places that the search did not check.
    """
    taus = np.random.default_rng(1).uniform(0.0, scaling.span, 4000)
    paces = [scaling.pace(tau) for tau in np.append(taus, (0.0, scaling.span)).tolist()]
    sigma = np.array([pace.sigma for pace in paces])
    f, s, t = np.array([(p.first, p.second, p.third) for p in paces]).T[:, :, None]
    _, q1, q2, q3 = joint_derivatives(path, sigma)
    one, two = q1 * f, q2 * f**2 + q1 * s
    three = q3 * f**3 + 3.0 * q2 * f * s + q1 * t
    a, j, limits = scaling.acceleration, scaling.jerk, bounds.joints
    _, p1, p2, _ = point_derivatives(path, sigma)
    tool, pushed = np.linalg.norm(p1 * f, axis=1), np.linalg.norm(p2 * f**2 + p1 * s, axis=1)
    jerk = np.abs(three) + 3.0 * np.abs(two) * a + np.abs(one) * j
    return np.array(
        [
            (np.abs(one) / limits.speed).max(),
            ((np.abs(two) + np.abs(one) * a) / limits.acceleration).max(),
            (jerk / limits.jerk).max(),
            tool.max() / bounds.tool_speed,
            (pushed + a * tool).max() / (bounds.tool_acceleration or math.inf),
        ]
    )


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", NAMES)
def test_limits_hold_for_any_tau(
    paths: dict[str, Path], scalings: dict[str, Scaling], bounds: Bounds, name: str
) -> None:
    load = loads(paths[name], scalings[name], bounds)
    assert load.max() <= 1.0
    assert load.max() > 0.98


def test_limits_hold_at_a_small_corner(bounds: Bounds, paths: dict[str, Path]) -> None:
    lines = paths["lines"]
    assert isinstance(lines, ToolPath)
    assert isinstance(lines.curve, ToolLines)
    sharp = replace(lines.curve, blend=np.array([0.02, 0.05, 1.0]))
    path = ToolPath(lines.chain, sharp, lines.branch, lines.near)
    assert loads(path, fastest(path, bounds), bounds).max() <= 1.0


@pytest.mark.parametrize("name", ["circle", "joints"])
def test_slowness_that_changes_much_keeps_the_limits(
    paths: dict[str, Path], bounds: Bounds, name: str
) -> None:
    sampled, rng = SampledPath.of(paths[name], bounds), np.random.default_rng(4)
    for _ in range(3):
        waves = np.exp(rng.uniform(-1.0, 1.0, len(sampled.first) + 3))
        slowness = np.convolve(np.pad(waves, 1, mode="edge"), (0.25, 0.5, 0.25), "valid")
        scaling = Scaling(slowness * sampled.excess(slowness, 1.0, 10.0).max(), 1.0, 10.0)
        assert 0.98 < loads(paths[name], scaling, bounds).max() <= 1.0


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", NAMES)
def test_duration_is_near_the_optimum(
    paths: dict[str, Path], scalings: dict[str, Scaling], bounds: Bounds, name: str
) -> None:
    least = least_time(paths[name], bounds)
    # The single slowness of a path cannot adapt to several small corners as the optimum does.
    most = 1.75 if name == "lines" else 1.5
    assert least < scalings[name].duration < most * least


def test_straight_line_reaches_its_limits(arm: ArmModel, paths: dict[str, Path]) -> None:
    """With limits of the joints only, the optimum is known: that of one joint."""
    bounds = Bounds(arm.limits, 50.0)
    scaling = fastest(paths["joints"], bounds)
    distance, limits = np.abs(paths["joints"].end - paths["joints"].start), arm.limits
    turning = distance > 0.0
    v, a, j = (
        float((limit[turning] / distance[turning]).min())
        for limit in (limits.speed, limits.acceleration, limits.jerk)
    )
    best = rest_to_rest(1.0 / v, a / v, j / v)
    assert best < scaling.duration < 1.01 * best


def test_a_full_cup_is_carried_gently(paths: dict[str, Path], bounds: Bounds) -> None:
    gentle = replace(bounds, tool_acceleration=0.3)
    scaling = fastest(paths["line"], gentle)
    load = loads(paths["line"], scaling, gentle)
    assert 0.98 < load[4] <= 1.0
    assert load.max() <= 1.0
    assert scaling.duration > fastest(paths["line"], bounds).duration


@pytest.mark.parametrize("name", NAMES)
def test_pace_is_the_inverse_of_tau_with_its_derivatives(
    scalings: dict[str, Scaling], name: str
) -> None:
    scaling, h = scalings[name], 1e-4
    assert scaling.pace(0.0).sigma == 0.0
    assert scaling.pace(scaling.span).sigma == pytest.approx(1.0, abs=1e-15)
    for tau in np.linspace(2.0 * h, scaling.span - 2.0 * h, 40).tolist():
        pace = scaling.pace(tau)
        assert scaling.tau(pace.sigma) == pytest.approx(tau, abs=1e-14)
        before, after = scaling.pace(tau - h), scaling.pace(tau + h)
        for low, high, rate in (
            (before.sigma, after.sigma, pace.first),
            (before.first, after.first, pace.second),
            (before.second, after.second, pace.third),
        ):
            assert (high - low) / (2.0 * h) == pytest.approx(rate, rel=1e-3, abs=1e-2)


@given(st.floats(1e-4, 20.0), st.floats(0.05, 30.0), st.floats(0.05, 200.0))
def test_the_time_from_rest_to_rest_is_that_of_ruckig(distance: float, a: float, j: float) -> None:
    wanted = InputParameter(1)
    wanted.target_position = [distance]
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = [1.0], [a], [j]
    trajectory = Trajectory(1)
    Ruckig(1).calculate(wanted, trajectory)
    assert rest_to_rest(distance, a, j) == pytest.approx(trajectory.duration, rel=1e-6)
    for t in np.linspace(0.0, trajectory.duration, 21).tolist():
        (position,), (speed,), (acceleration,) = trajectory.at_time(t)
        place, first, second = motion_after(t, distance, a, j)
        assert place == pytest.approx(position, rel=1e-5, abs=1e-6 * distance)
        # The times of ruckig are accurate to about 1e-8 s: the slack is that times the next
        # derivative.
        assert first == pytest.approx(speed, rel=1e-5, abs=1e-6 * (1.0 + a))
        assert second == pytest.approx(acceleration, rel=1e-5, abs=1e-5 * (1.0 + j))
    assert motion_after(-1.0, distance, a, j) == (0.0, 0.0, 0.0)
    assert motion_after(trajectory.duration + 1.0, distance, a, j) == (distance, 0.0, 0.0)


def test_invalid_numbers_are_refused(arm: ArmModel) -> None:
    for speed, acceleration in ((0.0, None), (math.nan, None), (0.5, -1.0), (0.5, math.inf)):
        with pytest.raises(InputError, match="above 0"):
            Bounds(arm.limits, speed, acceleration)
    for coefficients, a, j in ((np.ones(3), 1.0, 1.0), (np.zeros(5), 1.0, 1.0)):
        with pytest.raises(InputError):
            Scaling(coefficients, a, j)
    for a, j in ((0.0, 1.0), (1.0, -1.0), (math.nan, 1.0)):
        with pytest.raises(InputError):
            Scaling(np.ones(5), a, j)
