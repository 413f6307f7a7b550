from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.turns import wrapped
from katana450.maths.water.vectors import Vector, vector
from tests.kinematics.subproblems import (
    subproblem1,
    subproblem2,
    subproblem3,
    subproblem4,
)

CASES = 60
SCAN = np.linspace(-math.pi, math.pi, 7201)


def unit(rng: np.random.Generator) -> FloatArray:
    v: FloatArray = rng.normal(size=3)
    return v / np.linalg.norm(v)


def turn(omega: FloatArray, r: FloatArray, theta: float, p: FloatArray) -> FloatArray:
    return r + so3.exp(omega * theta) @ (p - r)


def circle(omega: FloatArray, r: FloatArray, p: FloatArray) -> FloatArray:
    """Return the points (7201, 3) that p passes in one turn."""
    u = p - r
    along = (omega @ u) * omega
    c, s = np.cos(SCAN)[:, None], np.sin(SCAN)[:, None]
    return r + along + c * (u - along) + s * np.cross(omega, u)


def contains(angles: tuple[float, ...], theta: float, within: float = 1e-9) -> bool:
    return any(abs(wrapped(a - theta)) < within for a in angles)


def vectors(
    a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray
) -> tuple[Vector, Vector, Vector, Vector]:
    return vector(a), vector(b), vector(c), vector(d)


@pytest.mark.parametrize(
    ("theta", "expected"),
    [(0.0, 0.0), (-math.pi, math.pi), (math.pi, math.pi), (7.0, 7.0 - math.tau)],
)
def test_wrapped_is_in_the_half_open_turn(theta: float, expected: float) -> None:
    assert wrapped(theta) == pytest.approx(expected, abs=1e-15)


def test_1_finds_the_one_angle(rng: np.random.Generator) -> None:
    for _ in range(CASES):
        omega, r, p = unit(rng), rng.normal(size=3), rng.normal(size=3)
        theta = rng.uniform(-math.pi, math.pi)
        got = subproblem1(*vectors(omega, r, p, turn(omega, r, theta, p)))
        assert len(got.angles) == 1
        assert got.exact
        assert not got.free
        assert contains(got.angles, theta, 1e-13)


def test_1_without_an_exact_angle_comes_nearest(rng: np.random.Generator) -> None:
    for _ in range(CASES):
        omega, r, p, q = unit(rng), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
        got = subproblem1(*vectors(omega, r, p, q))
        assert not got.exact
        d = np.linalg.norm(turn(omega, r, got.angles[0], p) - q)
        assert d <= np.linalg.norm(circle(omega, r, p) - q, axis=1).min() + 1e-12


def test_1_on_the_axis_leaves_the_angle_free(rng: np.random.Generator) -> None:
    omega, r = unit(rng), rng.normal(size=3)
    on_axis = r + 0.4 * omega
    got = subproblem1(*vectors(omega, r, on_axis, on_axis))
    assert (got.angles, got.exact, got.free) == ((0.0,), True, True)
    got = subproblem1(*vectors(omega, r, on_axis, on_axis + omega))
    assert (got.angles, got.exact, got.free) == ((0.0,), False, True)


def test_2_finds_both_pairs(rng: np.random.Generator) -> None:
    for _ in range(CASES):
        w1, w2, r, p = unit(rng), unit(rng), rng.normal(size=3), rng.normal(size=3)
        t1, t2 = rng.uniform(-math.pi, math.pi, size=2)
        q = turn(w1, r, t1, turn(w2, r, t2, p))
        got = subproblem2(*vectors(w1, w2, r, p), vector(q))
        assert len(got.pairs) == 2
        assert got.exact
        for a, b in got.pairs:
            np.testing.assert_allclose(turn(w1, r, a, turn(w2, r, b, p)), q, atol=1e-7)
        misses = [abs(wrapped(a - t1)) + abs(wrapped(b - t2)) for a, b in got.pairs]
        assert min(misses) < 1e-6


def test_2_without_an_exact_pair_comes_nearest(rng: np.random.Generator) -> None:
    inexact = 0
    for _ in range(CASES):
        w1, w2, r = unit(rng), unit(rng), rng.normal(size=3)
        p, q = rng.normal(size=3), rng.normal(size=3)
        got = subproblem2(*vectors(w1, w2, r, p), vector(q))
        inexact += len(got.pairs) == 1
        assert not got.exact
        # |R1 R2 p - q| = |R2 p - R1^T q|: the distance between two circles.
        first, second = circle(w2, r, p)[::20], circle(w1, r, q)[::20]
        scan = np.linalg.norm(first[:, None] - second[None], axis=2).min()
        for a, b in got.pairs:
            d = np.linalg.norm(turn(w1, r, a, turn(w2, r, b, p)) - q)
            assert d <= scan + 1e-9
    assert 5 < inexact < CASES - 5


def test_2_ill_posed_cases_are_named(rng: np.random.Generator) -> None:
    w, r, p = unit(rng), rng.normal(size=3), rng.normal(size=3)
    q = turn(w, r, 0.8, p)
    got = subproblem2(*vectors(w, w, r, p), vector(q))
    assert got.exact
    assert got.free
    assert got.pairs[0] == pytest.approx((0.8, 0.0))
    got = subproblem2(*vectors(w, unit(rng), r, r), vector(r))
    assert (got.pairs, got.exact, got.free) == (((0.0, 0.0),), True, True)
    other = unit(rng)
    on_second = r + 0.5 * other
    got = subproblem2(*vectors(w, other, r, on_second), vector(turn(w, r, 0.8, on_second)))
    assert got.free
    assert all(pair == pytest.approx((0.8, 0.0), abs=1e-6) for pair in got.pairs)


def test_3_finds_both_angles(rng: np.random.Generator) -> None:
    for _ in range(CASES):
        omega, r, p, q = unit(rng), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
        theta = rng.uniform(-math.pi, math.pi)
        delta = float(np.linalg.norm(q - turn(omega, r, theta, p)))
        got = subproblem3(*vectors(omega, r, p, q), delta)
        assert len(got.angles) == 2
        assert got.exact
        assert contains(got.angles, theta, 1e-7)
        for angle in got.angles:
            d = np.linalg.norm(q - turn(omega, r, angle, p))
            assert d == pytest.approx(delta, abs=1e-13)


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.5, 30.0])
def test_3_without_an_exact_angle_comes_nearest(rng: np.random.Generator, factor: float) -> None:
    for _ in range(CASES // 4):
        omega, r, p, q = unit(rng), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
        distances = np.linalg.norm(circle(omega, r, p) - q, axis=1)
        ends = float(distances.min()), float(distances.max())
        delta = factor * ends[0 if factor < 1.0 else 1]
        got = subproblem3(*vectors(omega, r, p, q), delta)
        assert not got.exact
        assert len(got.angles) == 1
        d = np.linalg.norm(q - turn(omega, r, got.angles[0], p))
        assert abs(d - delta) <= np.abs(distances - delta).min() + 1e-12


@pytest.mark.parametrize("bend", [0.0, 1e-9, 1e-5, math.pi - 1e-5, math.pi])
def test_3_keeps_its_digits_stretched_and_folded(bend: float) -> None:
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    p, shoulder, elbow = 0.329 * x, 0.0 * x, 0.190 * x
    delta = float(np.linalg.norm(turn(y, elbow, bend, p)))
    got = subproblem3(*vectors(y, elbow, p, shoulder), delta)
    assert got.exact
    assert len(got.angles) == 2
    for angle in got.angles:
        assert np.linalg.norm(turn(y, elbow, angle, p)) == pytest.approx(delta, abs=2e-16)


def test_3_on_the_axis_leaves_the_angle_free(rng: np.random.Generator) -> None:
    omega, r, q = unit(rng), rng.normal(size=3), rng.normal(size=3)
    p = r - 0.3 * omega
    delta = float(np.linalg.norm(p - q))
    got = subproblem3(*vectors(omega, r, p, q), delta)
    assert (got.angles, got.exact, got.free) == ((0.0,), True, True)
    got = subproblem3(*vectors(omega, r, p, q), delta + 0.1)
    assert (got.angles, got.exact, got.free) == ((0.0,), False, True)


def test_4_finds_both_angles(rng: np.random.Generator) -> None:
    for _ in range(CASES):
        omega, h, r, p = unit(rng), unit(rng), rng.normal(size=3), rng.normal(size=3)
        theta = rng.uniform(-math.pi, math.pi)
        d = float(h @ turn(omega, r, theta, p))
        got = subproblem4(*vectors(omega, r, p, h), d)
        assert len(got.angles) == 2
        assert got.exact
        assert contains(got.angles, theta, 1e-7)
        for angle in got.angles:
            assert h @ turn(omega, r, angle, p) == pytest.approx(d, abs=1e-14)


@pytest.mark.parametrize("outside", [-5.0, -0.1, 0.1, 5.0])
def test_4_without_an_exact_angle_comes_nearest(rng: np.random.Generator, outside: float) -> None:
    for _ in range(CASES // 4):
        omega, h, r, p = unit(rng), unit(rng), rng.normal(size=3), rng.normal(size=3)
        offsets = circle(omega, r, p) @ h
        d = float(outside + (offsets.max() if outside > 0.0 else offsets.min()))
        got = subproblem4(*vectors(omega, r, p, h), d)
        assert not got.exact
        assert len(got.angles) == 1
        misfit = abs(h @ turn(omega, r, got.angles[0], p) - d)
        assert misfit <= np.abs(offsets - d).min() + 1e-12


def test_4_ill_posed_cases_are_named(rng: np.random.Generator) -> None:
    omega, r, p = unit(rng), rng.normal(size=3), rng.normal(size=3)

    def flags(p: FloatArray, h: FloatArray, d: float) -> tuple[bool, bool]:
        got = subproblem4(*vectors(omega, r, p, h), d)
        assert got.angles == (0.0,)
        return got.exact, got.free

    h = unit(rng)
    on_axis = r + 2.0 * omega
    assert flags(on_axis, h, float(h @ on_axis)) == (True, True)
    assert flags(on_axis, h, float(h @ on_axis) + 0.1) == (False, True)
    assert flags(p, omega, float(omega @ p)) == (True, True)


def test_double_solutions_are_both_given() -> None:
    x, y, z = np.eye(3)
    origin = 0.0 * x
    got = subproblem4(*vectors(z, origin, x, x), 1.0)
    assert got.exact
    assert got.angles == pytest.approx((0.0, 0.0))
    got = subproblem3(*vectors(z, origin, x, 2.0 * y), 1.0)
    assert got.exact
    assert got.angles == pytest.approx((math.pi / 2, math.pi / 2))
