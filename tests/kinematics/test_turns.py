"""Angles are wrapped to the half-open turn."""

from __future__ import annotations

import math

import pytest

from katana450.maths.kinematics.turns import wrapped


@pytest.mark.parametrize(
    ("theta", "expected"),
    [(0.0, 0.0), (-math.pi, math.pi), (math.pi, math.pi), (7.0, 7.0 - math.tau)],
)
def test_wrapped_is_in_the_half_open_turn(theta: float, expected: float) -> None:
    assert wrapped(theta) == pytest.approx(expected, abs=1e-15)
