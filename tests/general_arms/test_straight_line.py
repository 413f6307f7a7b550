"""Closed forms written out for one arm give what the formulas give, and nothing is lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.closed_form import ClosedForm, errors_of
from katana450.extensions.general_arms.functions import FLOATS
from katana450.extensions.general_arms.links import reversed_chain
from katana450.extensions.general_arms.one_pose import one_pose
from katana450.extensions.general_arms.straight_line import TermList
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from tests.conftest import LONG
from tests.general_arms.published_arms import FOUR, KR_6, PUMA_560, SIX, UR5E

ARMS = FOUR | SIX | {"Puma 560 seen from the tool": reversed_chain(PUMA_560)}
POSTURES = 300 if LONG else 30


def closed_form(chain: Chain) -> ClosedForm:
    found = kinematics_of(chain)
    assert isinstance(found, ClosedForm)
    return found


def both(solver: ClosedForm, q: FloatArray, *, checks: bool = False) -> tuple[Any, FloatArray]:
    """Return the solutions (k, n) of the written-out function, and those of the formulas."""
    T, form, chain = forward(solver.chain, q), solver.form, solver.chain
    angles = q[::-1] if solver.is_reversed else q
    alpha = (angles + form.links.shift).tolist()
    columns = form.columns((se3.inverse(T) if solver.is_reversed else T)[None])
    rows = [[float(each[0]) for each in row] for row in columns]
    found = np.array(form.build(form.links, FLOATS)(rows, alpha)) - form.links.shift
    written = one_pose(chain, form, is_reversed=solver.is_reversed, checks=checks)
    return written(T.ravel().tolist(), alpha), found[:, ::-1] if solver.is_reversed else found


@pytest.mark.parametrize("name", ARMS)
def test_written_out_function_gives_what_the_formulas_give(name: str) -> None:
    solver = closed_form(ARMS[name])
    chain = solver.chain
    for q in np.random.default_rng(1).uniform(chain.lower, chain.upper, (POSTURES, chain.n)):
        written, found = both(solver, q)
        away = np.array(written) - found
        away -= math.tau * np.round(away / math.tau)
        # Beside a stretched elbow rounding is magnified to its root.
        assert np.sort(np.abs(away).max(axis=1))[: len(away) // 2].max() < 1e-9
        assert np.abs(away).max() < 1e-6
        for each in written:
            inside = (each >= chain.lower) & (each <= chain.upper)
            assert (inside | (np.abs(each) <= math.pi)).all()


@pytest.mark.parametrize("five", [0.0, 1e-12, 1e-7, 1e-3, 0.02, math.pi])
@pytest.mark.parametrize("three", [1.2, 0.0])
def test_written_out_function_does_rare_cases(five: float, three: float) -> None:
    q = np.array([0.3, -1.0, three, 0.4, five, 0.6])
    solver = closed_form(UR5E)
    written, found = both(solver, q)
    # Rounding is magnified in angles whose sum alone the pose determines, but not in the pose.
    T = forward(UR5E, q)
    errors = [errors_of(UR5E, np.array([each]), T[None]) for each in (written, found)]
    exact = [(place <= 1e-12) & (turn <= 1e-12) for place, turn in errors]
    assert exact[0].sum() >= 2
    np.testing.assert_array_equal(exact[0], exact[1])
    assert solver.solve(T, q.tolist()) == written


@pytest.mark.parametrize("name", ["UR5e", "KR 6"])
def test_function_that_checks_gives_the_same_or_none(name: str) -> None:
    solver = closed_form(SIX[name])
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.5, 0.6])
    T = forward(solver.chain, q)
    written, _ = both(solver, q, checks=True)
    assert written == solver.solve(T, q.tolist())
    check = one_pose(solver.chain, solver.form, is_reversed=solver.is_reversed, checks=True)
    assert check(T.ravel().tolist()) == solver.solve(T)
    for place in range(16):
        for value in (math.nan, math.inf, T.flat[place] + 1e-9):
            numbers = T.ravel().tolist()
            numbers[place] = value
            # The tool point may be anywhere that is finite.
            moved = place in (3, 7, 11) and math.isfinite(value)
            assert (check(numbers) is None) is not moved


@pytest.mark.parametrize("joint", [3, 5])
def test_free_angle_of_a_singular_wrist_is_that_of_the_caller(joint: int) -> None:
    q = np.array([0.3, -0.9, 1.2, 0.4, 0.0, 0.6])
    written, _ = both(closed_form(KR_6), q)
    assert min(abs(each[joint] - q[joint]) for each in written) < 1e-9


@pytest.mark.parametrize("quarters", range(-5, 6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_half_turn_is_turned_from_both_sides(quarters: int, sign: float) -> None:
    terms = TermList()
    x, z = terms.term("x"), terms.operations().hypot(terms.term("y"), 0.0)
    angle = sign * terms.operations().atan2(z, x) + quarters * math.pi / 2.0
    solve = terms.compiled("x, y = pose", [[terms.turned(angle, -math.pi, math.pi)]])
    for given in (0.1, 1.0, 3.0):
        found = solve((math.cos(given), math.sin(given)), ())[0][0]
        away = found - (sign * given + quarters * math.pi / 2.0)
        assert away - math.tau * round(away / math.tau) == pytest.approx(0.0, abs=1e-14)
        assert abs(found) <= math.pi


@pytest.mark.parametrize(
    ("span", "angles", "expected"),
    [
        ((-math.pi, math.pi), (3.0, -3.0), (3.0, -3.0)),
        ((0.0, math.tau), (4.0, 1.0), (4.0 - math.tau, 1.0)),
        ((-math.tau, 0.0), (-4.0, -1.0), (math.tau - 4.0, -1.0)),
        ((-9.0, 9.0), (9.0, -9.0), (9.0 - math.tau, math.tau - 9.0)),
        ((0.0, 16.0), (16.0, 1.0), (16.0 - 3.0 * math.tau, 1.0)),
    ],
)
def test_angle_is_brought_into_a_turn_from_where_it_can_be(
    span: tuple[float, float], angles: tuple[float, ...], expected: tuple[float, ...]
) -> None:
    terms = TermList()
    a = terms.term("a", span=span)
    solve = terms.compiled("a, = pose", [[terms.turned(a, -math.pi, math.pi)]])
    for angle, turned in zip(angles, expected, strict=True):
        assert solve((angle,), ())[0][0] == pytest.approx(turned, abs=1e-15)


@pytest.mark.parametrize(
    ("limits", "angle", "expected"),
    [
        ((-4.0, 1.0), 2.9, 2.9 - math.tau),
        ((-4.0, 1.0), 2.0, 2.0),
        ((-1.0, 4.0), -2.9, math.tau - 2.9),
        ((-math.pi, 3.0), math.pi, -math.pi),
        ((-1.0, 1.0), 2.0, 2.0),
        ((-7.0, 7.0), 3.0, 3.0),
    ],
)
def test_angle_is_brought_into_the_turn_inside_its_limits(
    limits: tuple[float, float], angle: float, expected: float
) -> None:
    terms = TermList()
    a = terms.term("a", span=(-math.pi, math.pi))
    solve = terms.compiled("a, = pose", [[terms.turned(a, *limits)]])
    assert solve((angle,), ())[0][0] == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("limits", [(-3.4, 1.0), (-1.0, 3.4), (-4.0, 2.0), (-2.0, 4.5)])
@pytest.mark.parametrize("span", [(-4.0, 4.0), (-6.2, math.pi), (-math.pi, 6.2)])
def test_sum_of_angles_is_brought_inside_the_limits_in_one_step(
    limits: tuple[float, float], span: tuple[float, float]
) -> None:
    terms = TermList()
    a = terms.term("a", span=span)
    solve = terms.compiled("a, = pose", [[terms.turned(a, *limits)]])
    for angle in np.linspace(*span, 401).tolist():
        found = solve((angle,), ())[0][0]
        assert math.remainder(found - angle, math.tau) == pytest.approx(0.0, abs=1e-14)
        turns = [angle + k * math.tau for k in (-2, -1, 0, 1, 2)]
        if any(limits[0] - 1e-9 <= each <= limits[1] + 1e-9 for each in turns):
            assert limits[0] - 1e-9 <= found <= limits[1] + 1e-9
        else:
            assert abs(found) <= math.pi + 1e-9
