"""The formulas of a closed form written out for one arm, as one straight line of Python.

The formulas run once with terms in place of numbers, and the terms become the text of a function.
Products with 0 and 1 vanish, loops and calls are unrolled, equal terms are computed once, and of
two values that a condition selects only one is computed. So the formulas stay as they are written,
and one pose costs little more than the roots, angles and products that it needs.

Python compiles the text. It consists of the operations below and of numbers, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from katana450 import tolerances
from katana450.extensions.general_arms.functions import FLOATS, Number, Operations
from katana450.maths.kinematics.turns import in_turn

Code = Callable[[Sequence[Any], Sequence[float]], Any]
"""A function of inputs and of free angles [rad]."""

NAMES: Final[dict[str, Any]] = {
    **{name: getattr(math, name) for name in ("atan2", "cos", "hypot", "remainder", "sin", "sqrt")},
    "in_turn": in_turn,
    "pi": math.pi,
    "tau": math.tau,
}
"""Functions and numbers that the text uses."""

PLUS, LESS, MINUS = "({0} + {1})", "({0} - {1})", "(-{0})"

Span = tuple[float, float]

NO_SPAN: Final[Span] = (-math.inf, math.inf)

ROUNDED: Final = 1e-14
"""[rad] Distance from the end of a turn that is only rounding."""


class Term:
    """A number that the function computes.

    Attributes:
        owner: list of all terms of the function.
        text: its text with a place for each argument.
        arguments: terms and numbers.
        number: counts the terms.
        span: between which numbers it lies.
    """

    # numpy leaves products with its numbers to this class.
    __array_ufunc__ = None
    __slots__ = ("arguments", "number", "owner", "span", "text")

    def __init__(
        self, owner: TermList, text: str, arguments: tuple[Number, ...], number: int, span: Span
    ) -> None:
        self.owner = owner
        self.text = text
        self.arguments = arguments
        self.number = number
        self.span = span

    def __add__(self, other: Number) -> Number:
        if _is(other, 0.0):
            return self
        if _has(other, MINUS):
            return self - other.arguments[0]
        (a, b), (c, d) = self.span, _span(other)
        return self.owner.term(PLUS, self, other, span=(a + c, b + d))

    def __radd__(self, other: Number) -> Number:
        return self + other

    def __sub__(self, other: Number) -> Number:
        if _is(other, 0.0):
            return self
        if _has(other, MINUS):
            return self + other.arguments[0]
        (a, b), (c, d) = self.span, _span(other)
        return self.owner.term(LESS, self, other, span=(a - d, b - c))

    def __rsub__(self, other: Number) -> Number:
        if other == 0.0:
            return -self
        a, b = self.span
        return self.owner.term(LESS, other, self, span=(other - b, other - a))

    def __mul__(self, other: Number) -> Number:
        if not isinstance(other, Term):
            return other * self
        if self.text == MINUS:
            return -(self.arguments[0] * other)
        if other.text == MINUS:
            return -(self * other.arguments[0])
        return self.owner.term("({0} * {1})", self, other)

    def __rmul__(self, other: Number) -> Number:
        if other == 0.0:
            return 0.0
        if abs(other) == 1.0:
            return self if other > 0.0 else -self
        if self.text == MINUS:
            return -other * self.arguments[0]
        a, b = sorted((other * self.span[0], other * self.span[1]))
        return self.owner.term("({0} * {1})", other, self, span=(a, b))

    def __truediv__(self, other: Number) -> Number:
        return self.owner.term("({0} / {1})", self, other)

    def __rtruediv__(self, other: Number) -> Number:
        return self.owner.term("({0} / {1})", other, self)

    def __neg__(self) -> Number:
        if self.text == MINUS:
            return self.arguments[0]
        if self.text == LESS:
            first, second = self.arguments
            return second - first
        return self.owner.term(MINUS, self, span=(-self.span[1], -self.span[0]))

    def __le__(self, other: Number) -> Number:
        return self.owner.term("({0} <= {1})", self, other)

    def __lt__(self, other: Number) -> Number:
        return self.owner.term("({0} < {1})", self, other)

    def __gt__(self, other: Number) -> Number:
        return self.owner.term("({0} > {1})", self, other)


def _is(value: Number, number: float) -> bool:
    return not isinstance(value, Term) and bool(value == number)


def _has(value: Number, text: str) -> bool:
    return isinstance(value, Term) and value.text == text


def _span(value: Number) -> Span:
    return value.span if isinstance(value, Term) else (float(value), float(value))


class TermList:
    """The terms of one function, in the order in which they were made.

    ``thorough``: whether the function does what is rarely needed. Else it returns None there.
    """

    def __init__(self, *, thorough: bool = True) -> None:
        self._thorough = thorough
        self._terms: dict[tuple[object, ...], Term] = {}
        self._rare: list[tuple[int, Term]] = []
        self._called: dict[str, Callable[..., tuple[float, ...]]] = {}

    def term(self, text: str, *arguments: Number, span: Span = NO_SPAN) -> Term:
        """Return the term of ``text``; equal ones are the same object."""
        key = (text, *(id(each) if isinstance(each, Term) else each for each in arguments))
        if key not in self._terms:
            self._terms[key] = Term(self, text, arguments, len(self._terms), span)
        return self._terms[key]

    def turned(self, angle: Term, lower: float, upper: float) -> Term:
        """Return ``angle`` [rad] in the turn inside its limits if there is one, else in a turn."""
        low, high = angle.span
        turn = math.pi + ROUNDED
        if -turn <= low and turn < high <= math.pi + math.tau:
            angle = self.term("({0} if {0} <= pi else {0} - tau)", angle)
        elif high <= turn and -math.pi - math.tau <= low < -turn:
            angle = self.term("({0} if {0} >= -pi else {0} + tau)", angle)
        elif low < -turn or high > turn:
            angle = self.term("({0} if -pi <= {0} <= pi else remainder({0}, tau))", angle)
        if not another_turn_helps(lower, upper):
            return angle
        text = "({0} if {1} <= {0} <= {2} else in_turn({0}, {1}, {2}))"
        return self.term(text, angle, lower, upper)

    def operations(self) -> Operations:
        """Return the functions that make terms."""
        return Operations(
            self._atan2,
            self._function("hypot", math.hypot, (0.0, math.inf)),
            self._function("cos", math.cos, (-1.0, 1.0)),
            self._function("sin", math.sin, (-1.0, 1.0)),
            self._root,
            self._select,
            self._bounded,
            self._rarely,
        )

    def _atan2(self, y: Number, x: Number) -> Number:
        span = (0.0 if _span(y)[0] >= 0.0 else -math.pi, math.pi)
        return self._function("atan2", math.atan2, span)(y, x)

    def _root(self, x: Number) -> Number:
        if not isinstance(x, Term):
            return FLOATS.root(x)
        return self.term("(sqrt({0}) if {0} > 0.0 else 0.0)", x, span=(0.0, math.inf))

    def _bounded(self, x: Number) -> Number:
        if not isinstance(x, Term):
            return FLOATS.bounded(x)
        text = "(-1.0 if {0} < -1.0 else 1.0 if {0} > 1.0 else {0})"
        return self.term(text, x, span=(-1.0, 1.0))

    def _select(self, condition: Number, a: Number, b: Number) -> Number:
        if not isinstance(condition, Term):
            return a if condition else b
        return self.term("({1} if {0} else {2})", condition, a, b)

    def _rarely(
        self,
        condition: Term,
        function: Callable[..., tuple[float, ...]],
        arguments: tuple[Number, ...],
        usual: tuple[Number, ...],
    ) -> tuple[Number, ...]:
        if not self._thorough:
            if condition not in self._conditions:
                self._rare.append((len(self._terms), condition))
            return usual
        name = function.__name__
        self._called[name] = function
        places = ", ".join(f"{{{k + 1}}}" for k in range(len(arguments)))
        made = self.term(f"({name}({places}) if {{0}} else ())", condition, *arguments)
        return tuple(
            self.term(f"({{1}}[{k}] if {{0}} else {{2}})", condition, made, each)
            for k, each in enumerate(usual)
        )

    def _function(
        self, name: str, function: Callable[..., float], span: Span
    ) -> Callable[..., Number]:
        def made(*arguments: Number) -> Number:
            if not any(isinstance(each, Term) for each in arguments):
                return function(*arguments)
            places = ", ".join(f"{{{k}}}" for k in range(len(arguments)))
            return self.term(f"{name}({places})", *arguments, span=span)

        return made

    def compiled(self, inputs: str, outputs: Sequence[Sequence[Number]]) -> Code:
        """Return the function of `text`."""
        names = {**NAMES, **self._called}
        exec(self.text(inputs, outputs), names)
        code: Code = names["solve"]
        return code

    def text(self, inputs: str, outputs: Sequence[Sequence[Number]]) -> str:
        """Return the text of the function of (rows, free) for ``outputs``.

        ``inputs``: the statement that takes the inputs apart.
        """
        uses = self._uses([*(each for values in outputs for each in values), *self._conditions])
        written: dict[int, str] = {}

        def text_of(value: Number) -> str:
            if not isinstance(value, Term):
                return repr(float(value))
            return written.get(value.number) or value.text.format(*map(text_of, value.arguments))

        lines, rare = [inputs], list(self._rare)
        for term in self._terms.values():
            while rare and rare[0][0] <= term.number:
                lines.append(f"if {text_of(rare.pop(0)[1])}: return None")
            if uses.get(term.number, 0) > 1 and not _is_rarely_used(term):
                lines.append(f"t{term.number} = {text_of(term)}")
                written[term.number] = f"t{term.number}"
        lines += [f"if {text_of(condition)}: return None" for _, condition in rare]
        tuples = ", ".join(f"({', '.join(map(text_of, each))},)" for each in outputs)
        lines.append(f"return [{tuples}]")
        return "\n    ".join(("def solve(rows, free):", *lines))

    @property
    def _conditions(self) -> list[Number]:
        return [condition for _, condition in self._rare]

    def _uses(self, values: Sequence[Number]) -> dict[int, int]:
        """Return how often the text has each term, by its number."""
        found: dict[int, int] = {}
        waiting = [each for each in values if isinstance(each, Term)]
        while waiting:
            term = waiting.pop()
            found[term.number] = found.get(term.number, 0) + 1
            if found[term.number] == 1:
                for k, each in enumerate(term.arguments):
                    if isinstance(each, Term):
                        waiting += [each] * term.text.count(f"{{{k}}}")
        return found


def another_turn_helps(lower: float, upper: float) -> bool:
    """Return whether an angle in [-pi, pi] may be inside the limits [rad] after a whole turn.

    It can only be beyond one limit then, and the other one beyond a half turn.
    """
    slack = tolerances.LIMIT_SLACK
    return (lower <= slack - math.pi) != (upper >= math.pi - slack)


def _is_rarely_used(term: Term) -> bool:
    """Return whether a term is an input, or made of a free angle, which is rarely used."""
    return all(isinstance(each, Term) and each.text.startswith("free") for each in term.arguments)
