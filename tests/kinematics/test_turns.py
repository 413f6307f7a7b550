"""Angles are wrapped to the half-open turn."""

from __future__ import annotations

import math

import pytest

from katana450.maths.kinematics.turns import another_turn_helps, in_turn, wrapped


@pytest.mark.parametrize(
    ("theta", "expected"),
    [(0.0, 0.0), (-math.pi, math.pi), (math.pi, math.pi), (7.0, 7.0 - math.tau)],
)
def test_wrapped_is_in_the_half_open_turn(theta: float, expected: float) -> None:
    assert wrapped(theta) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(
    ("lower", "upper", "expected"),
    [
        (-math.tau, math.tau, False),
        (-1.0, 1.0, False),
        (-math.pi, 3.0, True),
        (-4.0, 1.0, True),
        (-1.0, 3.4, True),
    ],
)
def test_another_turn_helps_if_some_angle_is_only_then_inside(
    lower: float, upper: float, *, expected: bool
) -> None:
    angles = [k * math.pi / 500.0 for k in range(-500, 501)]
    turned = [
        abs(in_turn(angle, lower, upper) - angle) > 1.0
        for angle in angles
        if abs(angle) < 3.1415926
    ]
    assert another_turn_helps(lower, upper) is expected
    assert any(turned) <= expected
