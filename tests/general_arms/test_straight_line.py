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


def test_products_with_zero_and_one_vanish_and_equal_terms_are_computed_once() -> None:
    terms = TermList()
    a, b = terms.term("a"), terms.term("b")
    assert 0.0 * a + 1.0 * b is b
    assert b + 0.0 is b
    assert b - 0.0 is b
    negative = -a
    assert -negative is a
    assert a * 0.0 == 0.0
    assert a - b is -(b - a)
    assert a + -b is a - b
    assert np.float64(1.0) * a is a
    assert a * b is a * b
    assert (a + 2.0) + 0.5 is a + 2.5
    assert (a + 2.0) - 0.5 is a + 1.5
    assert (2.0 - a) - 0.5 is 1.5 - a
    assert -(a + 2.0) is -2.0 - a
    assert (a - 2.0) + 2.0 is a
    outputs = [[a * b + a * b, -2.0 * (-a)]]
    assert terms.text("a, b = pose", outputs).count("a * b") == 1
    assert terms.compiled("a, b = pose", outputs)((3.0, 5.0), ()) == [(30.0, 6.0)]


def test_terms_that_differ_by_their_sign_are_computed_once() -> None:
    terms = TermList()
    a, b, c = (terms.term(name) for name in "abc")
    assert a * b is b * a
    assert a + b is b + a
    assert -a - b is -(a + b)
    assert -a + -b is -(a + b)
    assert -a + b is b - a
    assert (-a) * b is -(a * b)
    assert (-a) / b is -(a / b)
    assert a / -b is -(a / b)
    assert 1.0 / -a is -(1.0 / a)
    assert -3.0 * a is -(3.0 * a)
    assert 2.0 - -a is a + 2.0
    outputs = [[a * b - c, c + (-a) * b]]
    text = terms.text("a, b, c = pose", outputs)
    assert text.count("a * b") == 1
    assert terms.compiled("a, b, c = pose", outputs)((3.0, 5.0, 4.0), ()) == [(11.0, -11.0)]


def test_opposite_direction_and_quarter_turns_need_no_further_angle() -> None:
    terms = TermList()
    f = terms.operations()
    x, y = terms.term("x"), terms.term("y")
    angle = f.atan2(y, x)
    outputs = [
        terms.turned(each, -math.pi, math.pi)
        for each in (
            *(angle + quarters * math.pi / 2.0 for quarters in range(-5, 6)),
            f.atan2(-y, -x),
        )
    ]
    text = terms.text("x, y = pose", [outputs])
    # That of the direction, and that of the direction after a quarter turn.
    assert text.count("atan2") == 2
    solve = terms.compiled("x, y = pose", [outputs])
    for given in (0.3, 2.0, -0.4, -2.7):
        (found,) = solve((math.cos(given), math.sin(given)), ())
        expected = [given + quarters * math.pi / 2.0 for quarters in (*range(-5, 6), 2)]
        away = np.array(found) - expected
        np.testing.assert_allclose(away - math.tau * np.round(away / math.tau), 0.0, atol=1e-15)
        assert np.abs(found).max() <= math.pi


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


def test_only_one_way_of_a_fork_is_computed_and_both_are_brought_into_a_turn() -> None:
    terms = TermList()
    f = terms.operations()
    x, y = terms.term("x"), terms.term("y")
    product, unused = x * y, x + y
    angle, size = f.quickly(
        x > 0.0,
        lambda: (f.atan2(y, x), 1.0 / x),
        lambda: (f.select(x <= -5.0, product * product, product) + 0.0, unused),
    )
    outputs = [[terms.turned(angle + math.pi, -math.pi, math.pi), size]]
    text = terms.text("x, y = pose", outputs)
    # What only the rare way needs is computed there.
    assert text.index("else:") < text.index("x * y")
    solve = terms.compiled("x, y = pose", outputs)
    assert solve((1.0, 1.0), ()) == [(pytest.approx(-0.75 * math.pi), 1.0)]
    assert solve((0.0, 2.0), ()) == [(pytest.approx(math.pi), 2.0)]
    assert solve((-6.0, 0.5), ())[0][0] == pytest.approx(math.remainder(9.0 + math.pi, math.tau))
    assert f.quickly(True, lambda: (1.0,), lambda: (2.0,)) == (1.0,)
    assert f.quickly(x > 1.0, lambda: (3.0, x), lambda: (3.0, y))[0] == 3.0
    unneeded = terms.text("x, y = pose", [[x]])
    assert "if" not in unneeded


def test_only_the_value_that_a_condition_selects_is_computed() -> None:
    terms = TermList()
    operations = terms.operations()
    a = terms.term("a")
    root = operations.root(a)
    chosen = operations.select(a <= 0.0, 1.0, 1.0 / a)
    solve = terms.compiled("a, = pose", [[root, chosen]])
    assert solve((0.0,), ()) == [(0.0, 1.0)]
    assert solve((4.0,), ()) == [(2.0, 0.25)]
    assert operations.select(True, a, root) is a
    assert operations.bounded(2.0) == 1.0
    assert operations.hypot(3.0, 4.0) == 5.0


def test_comparison_of_a_named_term_is_written_where_it_decides() -> None:
    terms = TermList()
    f = terms.operations()
    a, b = terms.term("a"), terms.term("b")
    size = a * b
    outputs = [[f.select(size <= 1.0, a, b), f.select(size <= 1.0, b, size), abs(size)]]
    text = terms.text("a, b = pose", outputs)
    assert text.count("a * b") == 1
    assert text.count("<= 1.0") == 2
    solve = terms.compiled("a, b = pose", outputs)
    assert solve((-2.0, 3.0), ()) == [(-2.0, 3.0, 6.0)]
    assert solve((2.0, 3.0), ()) == [(3.0, 6.0, 6.0)]


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
