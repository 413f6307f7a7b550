"""Arithmetic in scripts: numbers with units, names and functions; no other code is executed."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

MAX_LENGTH = 200
"""Maximum number of characters of an expression."""

PLAIN, LENGTH, ANGLE, TIME = "number", "length", "angle", "time"
"""The kinds of quantities."""

UNITS = {
    "mm": (1.0, LENGTH),
    "cm": (10.0, LENGTH),
    "m": (1e3, LENGTH),
    "in": (25.4, LENGTH),
    "deg": (1.0, ANGLE),
    "rad": (math.degrees(1.0), ANGLE),
    "ms": (1e-3, TIME),
    "s": (1.0, TIME),
    "min": (60.0, TIME),
}
"""The units by name, in mm, deg, s and N, with their kinds."""

WITH_UNIT = re.compile(
    rf"(?<![\w.])((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*({'|'.join(UNITS)})(?![\w(.])"
)
"""Pattern of a number with its unit."""


class ExpressionError(ValueError):
    """An expression without a value, with the reason."""


@dataclass(frozen=True)
class Quantity:
    """A number and its kind.

    Attributes:
        value: in mm, deg, s or N, or without a unit.
        kind: PLAIN, LENGTH, ANGLE or TIME. PLAIN takes the kind of what it is added to.
    """

    value: float
    kind: str = PLAIN


def evaluate(text: str, names: Mapping[str, Quantity]) -> Quantity:
    """Return the value of ``text`` with ``names`` for quantities. Raises ExpressionError."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"an expression has at most {MAX_LENGTH} characters")
    try:
        tree = ast.parse(WITH_UNIT.sub(r"_\2(\1)", text.strip()), mode="eval")
        quantity = _value(tree.body, names)
    except (SyntaxError, RecursionError, MemoryError) as error:
        raise ExpressionError(f"{text!r} is not an expression") from error
    except (ArithmeticError, ValueError) as error:
        if isinstance(error, ExpressionError):
            raise
        raise ExpressionError(f"{text!r} has no value: {error}") from error
    if not math.isfinite(quantity.value):
        raise ExpressionError(f"{text!r} has no finite value")
    return quantity


def _value(node: ast.expr, names: Mapping[str, Quantity]) -> Quantity:
    match node:
        case ast.Constant(value=float() | int() as number) if not isinstance(number, bool):
            return Quantity(float(number))
        case ast.Name(id=name):
            if name in names:
                return names[name]
            if name == "pi":
                return Quantity(math.pi)
            raise ExpressionError(f"there is no value {name!r}")
        case (
            ast.Attribute(value=ast.Name(id=name), attr=part)
            | ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int() as part))
        ):
            if f"{name}.{part}" not in names:
                raise ExpressionError(f"there is no value {ast.unparse(node)!r}")
            return names[f"{name}.{part}"]
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=inner):
            quantity = _value(inner, names)
            return Quantity(
                -quantity.value if isinstance(op, ast.USub) else quantity.value, quantity.kind
            )
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.Call(
            func=ast.Name(id=name), args=[ast.Constant(value=float() | int() as number)]
        ) if name[1:] in UNITS:
            scale, kind = UNITS[name[1:]]
            return Quantity(scale * number, kind)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _call(name, [_value(argument, names) for argument in arguments])
    raise ExpressionError("only numbers, names, + - * / % ** and functions are allowed")


def _sum(function: Callable[[float, float], float]) -> Callable[[Quantity, Quantity], Quantity]:
    def of(a: Quantity, b: Quantity) -> Quantity:
        return Quantity(function(a.value, b.value), _common(a, b))

    return of


def _product(a: Quantity, b: Quantity) -> Quantity:
    if PLAIN not in (a.kind, b.kind):
        raise ExpressionError(
            f"{with_article(a.kind)} times {with_article(b.kind)} has no unit here: one of them "
            "must be without a unit"
        )
    return Quantity(a.value * b.value, b.kind if a.kind == PLAIN else a.kind)


def _quotient(a: Quantity, b: Quantity) -> Quantity:
    if b.kind not in (PLAIN, a.kind):
        same = "" if a.kind == PLAIN else f" or by {with_article(a.kind)}"
        raise ExpressionError(
            f"{with_article(a.kind)} divided by {with_article(b.kind)} has no unit here: divide by "
            f"a number{same}"
        )
    return Quantity(a.value / b.value, PLAIN if a.kind == b.kind else a.kind)


def _power(a: Quantity, b: Quantity) -> Quantity:
    if (a.kind, b.kind) != (PLAIN, PLAIN):
        raise ExpressionError("a power needs numbers without units")
    return Quantity(math.pow(a.value, b.value))


OPERATORS: dict[type[ast.operator], Callable[[Quantity, Quantity], Quantity]] = {
    ast.Add: _sum(operator.add),
    ast.Sub: _sum(operator.sub),
    ast.Mod: _sum(operator.mod),
    ast.Mult: _product,
    ast.Div: _quotient,
    ast.Pow: _power,
}

OF_ANGLE = {"sin": math.sin, "cos": math.cos, "tan": math.tan}
TO_ANGLE = {"asin": math.asin, "acos": math.acos, "atan": math.atan}
KEEPING: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "round": round,
    "floor": math.floor,
    "ceil": math.ceil,
}
OF_MANY: dict[str, Callable[..., float]] = {"min": min, "max": max, "hypot": math.hypot}
"""The functions, by their arguments and values: from an angle, to an angle, of one quantity that
keeps its kind, and of quantities of the same kind."""

FUNCTIONS = (*OF_ANGLE, *TO_ANGLE, *KEEPING, *OF_MANY, "sqrt", "atan2")


def _call(name: str, values: list[Quantity]) -> Quantity:
    if name not in FUNCTIONS:
        raise ExpressionError(f"there is no function {name!r}; choose from {', '.join(FUNCTIONS)}")
    numbers = [quantity.value for quantity in values]
    if name in OF_MANY and values:
        kind = values[0]
        for quantity in values[1:]:
            kind = Quantity(0.0, _common(kind, quantity))
        return Quantity(OF_MANY[name](*numbers) if len(numbers) > 1 else numbers[0], kind.kind)
    if name == "atan2" and len(values) == 2:
        _common(*values)
        return Quantity(math.degrees(math.atan2(*numbers)), ANGLE)
    if len(values) != 1 or name in (*OF_MANY, "atan2"):
        wanted = {"atan2": "two values"}.get(name, "values" if name in OF_MANY else "one value")
        raise ExpressionError(f"{name} takes {wanted}, not {len(values)}")
    (value,) = values
    if name in KEEPING:
        return Quantity(float(KEEPING[name](value.value)), value.kind)
    if name in OF_ANGLE:
        _need(name, value, ANGLE)
        return Quantity(OF_ANGLE[name](math.radians(value.value)))
    _need(name, value, PLAIN)
    if name in TO_ANGLE:
        return Quantity(math.degrees(TO_ANGLE[name](value.value)), ANGLE)
    return Quantity(math.sqrt(value.value))


def _need(name: str, value: Quantity, kind: str) -> None:
    if value.kind not in (PLAIN, kind):
        raise ExpressionError(f"{name} takes {with_article(kind)}, not {with_article(value.kind)}")


def _common(a: Quantity, b: Quantity) -> str:
    """Return the kind of a sum; a number without a unit takes the kind of the other."""
    if PLAIN not in (a.kind, b.kind) and a.kind != b.kind:
        raise ExpressionError(
            f"{with_article(a.kind)} and {with_article(b.kind)} cannot be added or compared"
        )
    return b.kind if a.kind == PLAIN else a.kind


def with_article(kind: str) -> str:
    """Return the name of a kind of quantity with its article."""
    return f"an {kind}" if kind == ANGLE else f"a {kind}"
