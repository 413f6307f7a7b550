"""Test the arithmetic of scripts: units, names, functions, and what is refused."""

from __future__ import annotations

import math
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.extensions.programs.language.expression import (
    ANGLE,
    LENGTH,
    MAX_LENGTH,
    PLAIN,
    TIME,
    ExpressionError,
    Quantity,
    evaluate,
)

NAMES = {
    "radius": Quantity(40.0, LENGTH),
    "turn": Quantity(30.0, ANGLE),
    "i": Quantity(3.0),
    "corner.x": Quantity(300.0, LENGTH),
    "list.1": Quantity(7.0),
}


@pytest.mark.parametrize(
    ("text", "value", "kind"),
    [
        ("120", 120.0, PLAIN),
        ("120 mm", 120.0, LENGTH),
        ("0.2 m + 5 mm", 205.0, LENGTH),
        ("2cm", 20.0, LENGTH),
        ("1 in", 25.4, LENGTH),
        ("1e-3 m", 1.0, LENGTH),
        (".5 rad", math.degrees(0.5), ANGLE),
        ("2 min + 500 ms", 120.5, TIME),
        ("radius * 2", 80.0, LENGTH),
        ("radius / (2 cm)", 2.0, PLAIN),
        ("-radius + 5", -35.0, LENGTH),
        ("corner.x - 1", 299.0, LENGTH),
        ("list[1]", 7.0, PLAIN),
        ("i % 2", 1.0, PLAIN),
        ("2 ** i", 8.0, PLAIN),
        ("radius * sin(turn)", 20.0, LENGTH),
        ("cos(60)", 0.5, PLAIN),
        ("atan2(1 mm, 1 mm)", 45.0, ANGLE),
        ("hypot(3 mm, 4 mm)", 5.0, LENGTH),
        ("max(1, 2 mm, 3)", 3.0, LENGTH),
        ("sqrt(2) ** 2 * pi", 2 * math.pi, PLAIN),
    ],
)
def test_expression_has_value_and_kind(text: str, value: float, kind: str) -> None:
    result = evaluate(text, NAMES)
    assert result.value == pytest.approx(value, rel=1e-12)
    assert result.kind == kind


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("radius + turn", "a length and an angle cannot be added"),
        ("radius * radius", "a length times a length"),
        ("2 / radius", "a number divided by a length"),
        ("radius ** 2", "without units"),
        ("sin(radius)", "sin takes an angle, not a length"),
        ("acos(2)", "no value"),
        ("1 / 0", "no value"),
        ("10 ** 400", "no value"),
        ("1e308 * 10", "no finite value"),
        ("sin()", "sin takes one value, not 0"),
        ("atan2(1)", "atan2 takes two values, not 1"),
        ("min()", "min takes values, not 0"),
        ("3 mm 4", "not an expression"),
        ("1 +", "not an expression"),
        ("(1, 2)", "only numbers"),
        ("'a' * 3", "only numbers"),
        ("True", "only numbers"),
        ("i if i else 2", "only numbers"),
        ("[1][0]", "only numbers"),
        ("i.__class__", "no value"),
        ("__import__('os').system('true')", "only numbers"),
        ("(lambda: 1)()", "only numbers"),
        ("exec(i)", "no function 'exec'"),
        ("9" * (MAX_LENGTH + 1), "at most"),
        ("(" * 190 + "1", "not an expression"),
    ],
)
def test_expression_is_refused(text: str, said: str) -> None:
    with pytest.raises(ExpressionError, match=said.replace("(", r"\(")):
        evaluate(text, NAMES)


def test_unknown_name_is_named() -> None:
    with pytest.raises(ExpressionError, match="'radios'"):
        evaluate("radios * 2", NAMES)


@given(st.text(max_size=40))
def test_any_text_has_a_finite_value_or_is_refused(text: str) -> None:
    with suppress(ExpressionError):
        assert math.isfinite(evaluate(text, NAMES).value)
