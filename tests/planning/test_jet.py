"""Taylor series: identities that hold to rounding, on floats and on arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.maths.planning.jet import Jet, atan2, direction, sin_cos, sqrt

numbers = st.floats(-2.0, 2.0)
jets = st.builds(Jet, numbers, numbers, numbers, numbers)


def same(a: Jet, b: Jet, scale: float = 1.0) -> None:
    for x, y in zip(a.derivatives(), b.derivatives(), strict=True):
        assert x == pytest.approx(y, rel=1e-9, abs=1e-9 * scale)


@given(jets)
def test_the_angle_of_sine_and_cosine_is_the_angle(a: Jet) -> None:
    s, c = sin_cos(a)
    same(s * s + c * c, Jet.constant(1.0))
    same(atan2(s, c), a)
    same(atan2(3.0 * s, 3.0 * c), a)


@given(jets, st.builds(Jet, st.floats(0.5, 2.0), numbers, numbers, numbers))
def test_quotients_and_roots_undo_products(a: Jet, b: Jet) -> None:
    same(a * b / b, a, 1e3)
    same(sqrt(b * b), b, 1e3)
    same(2.0 - (b - a) - a, 2.0 - b)
    same((a + 1.0) * b - b, a * b, 1e3)
    angle, c, s = direction(b * 0.6, b * 0.8)
    same(angle, Jet.constant(math.atan2(0.6, 0.8)))
    same(c, Jet.constant(0.8))
    same(s, Jet.constant(0.6))


def test_derivatives_are_those_of_the_textbook() -> None:
    t = Jet.variable(0.7)
    s, c = sin_cos(2.0 * t)
    sin, cos = math.sin(1.4), math.cos(1.4)
    assert s.derivatives() == pytest.approx((sin, 2.0 * cos, -4.0 * sin, -8.0 * cos))
    assert c.derivatives() == pytest.approx((cos, -2.0 * sin, -4.0 * cos, 8.0 * sin))
    root = math.sqrt(0.7)
    wanted = (root, 0.5 / root, -0.25 / root**3, 0.375 / root**5)
    assert sqrt(t).derivatives() == pytest.approx(wanted)
    assert (t * t * t).derivatives() == pytest.approx((0.343, 1.47, 4.2, 6.0))


def test_many_places_equal_single_places() -> None:
    places = np.linspace(0.1, 0.9, 7)

    def f(t: Jet) -> Jet:
        s, c = sin_cos(3.0 * t - 1.0)
        return atan2(s * t + 0.2, 1.0 - c / (2.0 + t)) * sqrt(t)

    many = np.array(np.broadcast_arrays(*f(Jet.variable(places)).derivatives()))
    for number, place in enumerate(places.tolist()):
        assert f(Jet.variable(place)).derivatives() == pytest.approx(many[:, number], rel=1e-12)
