"""The formulas of a closed form written out for one arm, as one Python function without calls.

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
from katana450.extensions.general_arms.function_text import FunctionText
from katana450.extensions.general_arms.functions import FLOATS, Number, Numbers, Operations
from katana450.extensions.general_arms.term import (
    LESS,
    MINUS,
    NO_SPAN,
    PLUS,
    Fork,
    Need,
    Span,
    Term,
    TermBlock,
    has,
    span_of,
)
from katana450.maths.kinematics.turns import in_turn, wrapped

Code = Callable[..., Any]
"""A function of inputs, and of free angles [rad]."""

NAMES: Final[dict[str, Any]] = {
    **{name: getattr(math, name) for name in ("atan2", "cos", "hypot", "remainder", "sin", "sqrt")},
    "in_turn": in_turn,
}
"""Functions that the text uses."""

ATAN2: Final = "atan2({0}, {1})"
PI, TAU = repr(math.pi), repr(math.tau)
THREE_HALVES: Final = 3.0 * math.pi + 1e-14
NEXT: Final = f"({{0}} - {TAU} if {{0}} > {PI} else {{0}} + {TAU} if {{0}} < -{PI} else {{0}})"
ONE_LESS: Final = f"({{0}} if {{0}} <= {PI} else {{0}} - {TAU})"
ONE_MORE: Final = f"({{0}} if {{0}} >= -{PI} else {{0}} + {TAU})"
WRAPPED: Final = (NEXT, ONE_LESS, ONE_MORE)
WITHIN: Final = f"({{0}} - {TAU} if {{0}} > {{2}} else {{0}} + {TAU} if {{0}} < {{1}} else {{0}})"
NEAREST: Final = (
    f"({{0}} if -{PI} <= {{0}} <= {PI} else {{0}} - {TAU} if 0.0 < {{0}} <= {3.0 * math.pi!r} "
    f"else {{0}} + {TAU} if -{3.0 * math.pi!r} <= {{0}} < 0.0 else remainder({{0}}, {TAU}))"
)
"""Angles in a turn: of an angle that is one turn away at most, and of any."""

QUARTER: Final = 0.5 * math.pi
HALF: Final[Span] = (0.0, math.pi)
TURN: Final[Span] = (-math.pi, math.pi)

ROUNDED: Final = 1e-14
"""[rad] Distance from the end of a turn that is only rounding."""


class TermList:
    """The terms of one function, in the order in which they were made."""

    def __init__(self) -> None:
        self._blocks = [TermBlock()]
        self._count = 0
        self._called: dict[str, Callable[..., tuple[float, ...]]] = {}
        self._turned: dict[tuple[int, float], Term] = {}

    def term(self, text: str, *arguments: Number, span: Span = NO_SPAN) -> Term:
        """Return the term of ``text``; equal ones are the same object."""
        key = (text, *(id(each) if isinstance(each, Term) else each for each in arguments))
        for block in self._blocks:
            if key in block.known:
                return block.known[key]
        made = self._made(text, arguments, span)
        self._blocks[-1].known[key] = made
        self._blocks[-1].items.append(made)
        return made

    def _made(self, text: str, arguments: tuple[Number, ...], span: Span) -> Term:
        self._count += 1
        return Term(self, text, arguments, self._count, span)

    def require(self, *conditions: Term) -> None:
        """Let the function return None where one of the conditions does not hold."""
        self._blocks[-1].items.append(Need(conditions))

    def turned(self, angle: Number, lower: float, upper: float) -> Number:
        """Return ``angle`` [rad] in the turn inside its limits if there is one, else in a turn."""
        return self._inside(self._in_turn(angle), lower, upper)

    def _in_turn(self, angle: Number) -> Number:
        if not isinstance(angle, Term):
            return wrapped(angle)
        sign, base, offset = _parts(angle)
        if base.forked is not None and sign > 0.0:
            return self._joined(base, offset)
        quarters = round(offset / QUARTER)
        if base.text == ATAN2 and abs(offset - quarters * QUARTER) < ROUNDED:
            # A quarter turn is one of the direction, and costs nothing.
            y, x = base.arguments
            if base.span == HALF and quarters % 4 == 2:
                return -sign * self.term(ATAN2, y, -x, span=HALF)
            if base.span == TURN and sign > 0.0:
                found = self.term(ATAN2, x, -y, span=TURN) if quarters % 2 else base
                if quarters % 4 < 2:
                    return found
                return self.term(f"({{0}} - {PI} if {{0}} > 0.0 else {{0}} + {PI})", found)
        low, high = angle.span
        end, farthest = math.pi + ROUNDED, math.pi + math.tau + ROUNDED
        if -end <= low and end < high <= farthest:
            return self.term(ONE_LESS, angle)
        if high <= end and -farthest <= low < -end:
            return self.term(ONE_MORE, angle)
        if low < -end or high > end:
            return self.term(NEXT if max(-low, high) <= THREE_HALVES else NEAREST, angle)
        return angle

    def _joined(self, base: Term, offset: float) -> Term:
        """Return the angle ``base`` + ``offset`` [rad] in a turn, on both ways of its fork."""
        key = (base.number, offset)
        if key not in self._turned:
            assert base.forked is not None
            fork, place = base.forked
            outside, values = self._blocks, []
            for block, way in zip(fork.blocks, fork.values, strict=True):
                self._blocks = [*fork.path, block]
                values.append(self._in_turn(way[place] + offset))
            self._blocks = outside
            self._turned[key] = self._value(fork, *values)
        return self._turned[key]

    def _inside(self, angle: Term, lower: float, upper: float) -> Term:
        if not another_turn_helps(lower, upper):
            return angle
        slack = tolerances.LIMIT_SLACK
        # The only other turn that can be inside is the next one if an end is beyond a half turn.
        is_low = lower <= slack - math.pi
        if (is_low and upper >= -math.pi) or (not is_low and lower <= math.pi):
            if is_low:
                end = max(upper + slack, lower - slack + math.tau)
                start = end - math.tau
            else:
                start = min(lower - slack, upper + slack - math.tau)
                end = start + math.tau
            if angle.text in WRAPPED:
                # One step instead of two, if it is a turn at most.
                whole = angle.arguments[0]
                if start - math.tau < whole.span[0] and whole.span[1] < end + math.tau:
                    return self.term(WITHIN, whole, start, end)
            if is_low:
                return self.term(f"({{0}} if {{0}} <= {{1}} else {{0}} - {TAU})", angle, end)
            return self.term(f"({{0}} if {{0}} >= {{1}} else {{0}} + {TAU})", angle, start)
        text = "({0} if {1} <= {0} <= {2} else in_turn({0}, {1}, {2}))"
        return self.term(text, angle, lower, upper)

    def operations(self) -> Operations:
        """Return the functions that make terms."""
        return Operations(
            self._atan2,
            self._hypot,
            self._function("cos", math.cos, (-1.0, 1.0)),
            self._function("sin", math.sin, (-1.0, 1.0)),
            self._root,
            self._select,
            self._bounded,
            self._rarely,
            self._quickly,
        )

    def _atan2(self, y: Number, x: Number) -> Number:
        if has(y, MINUS) and has(x, MINUS):
            # The opposite direction.
            return self._atan2(-y, -x) + math.pi
        span = (0.0 if span_of(y)[0] >= 0.0 else -math.pi, math.pi)
        return self._function("atan2", math.atan2, span)(y, x)

    def _hypot(self, *sides: Number) -> Number:
        """Return the root of the sum of squares, which of two sides is faster than `math.hypot`."""
        if not any(isinstance(each, Term) for each in sides):
            return math.hypot(*sides)
        places = ", ".join(f"{{{k}}}" for k in range(len(sides)))
        text = "sqrt({0} * {0} + {1} * {1})" if len(sides) == 2 else f"hypot({places})"
        return self.term(text, *sides, span=(0.0, math.inf))

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
        name = function.__name__
        self._called[name] = function

        def called() -> Numbers:
            places = ", ".join(f"{{{k}}}" for k in range(len(arguments)))
            made = self.term(f"{name}({places})", *arguments)
            # Where the usual value is an angle in a turn, so is this one.
            spans = [
                span if max(-span[0], span[1]) <= math.pi else NO_SPAN
                for span in map(span_of, usual)
            ]
            return tuple(self.term(f"{{0}}[{k}]", made, span=span) for k, span in enumerate(spans))

        return self._forked(condition, called, lambda: usual, rare=0)

    def _quickly(
        self, condition: Number, quick: Callable[[], Numbers], careful: Callable[[], Numbers]
    ) -> Numbers:
        return self._forked(condition, quick, careful, rare=1)

    def _forked(
        self,
        condition: Number,
        first: Callable[[], Numbers],
        second: Callable[[], Numbers],
        rare: int,
    ) -> Numbers:
        if not isinstance(condition, Term):
            return first() if condition else second()
        fork = Fork(condition, rare, tuple(self._blocks))
        found = []
        for block, function in zip(fork.blocks, (first, second), strict=True):
            self._blocks.append(block)
            found.append(function())
            self._blocks.pop()
        self._blocks[-1].items.append(fork)
        return tuple(
            a
            if not isinstance(a, Term) and not isinstance(b, Term) and a == b
            else self._value(fork, a, b)
            for a, b in zip(*found, strict=True)
        )

    def _value(self, fork: Fork, a: Number, b: Number) -> Term:
        """Return the term that is ``a`` on one way of ``fork``, and ``b`` on the other."""
        (low, high), (lower, upper) = span_of(a), span_of(b)
        made = self._made("", (), (min(low, lower), max(high, upper)))
        made.text, made.forked = f"t{made.number}", (fork, len(fork.terms))
        fork.terms.append(made)
        for values, each in zip(fork.values, (a, b), strict=True):
            values.append(each)
        return made

    def _function(
        self, name: str, function: Callable[..., float], span: Span
    ) -> Callable[..., Number]:
        def made(*arguments: Number) -> Number:
            if not any(isinstance(each, Term) for each in arguments):
                return function(*arguments)
            places = ", ".join(f"{{{k}}}" for k in range(len(arguments)))
            return self.term(f"{name}({places})", *arguments, span=span)

        return made

    def compiled(
        self, inputs: str, outputs: Sequence[Sequence[Number]], free: Sequence[float] = ()
    ) -> Code:
        """Return the function of `text`, with ``free`` for the free angles by default."""
        names = {**NAMES, **self._called, "usual": tuple(free)}
        exec(self.text(inputs, outputs), names)
        code: Code = names["solve"]
        return code

    def text(self, inputs: str, outputs: Sequence[Sequence[Number]]) -> str:
        """Return the text of the function of (pose, free) for ``outputs``.

        ``inputs``: the statement that takes the inputs apart.
        """
        text = FunctionText(self._blocks[0], outputs)
        tuples = ", ".join(f"({', '.join(map(text.of, each))},)" for each in outputs)
        lines = ("def solve(pose, free=usual):", inputs, *text.lines, f"return [{tuples}]")
        return "\n    ".join(lines)


def _parts(angle: Term) -> tuple[float, Term, float]:
    """Return sign, term and offset of ``angle``, which is sign * term + offset."""
    sign, offset = 1.0, 0.0
    while True:
        first, second = (*angle.arguments, None, None)[:2]
        if angle.text == MINUS:
            sign, angle = -sign, first
        elif angle.text in (PLUS, LESS) and not isinstance(second, Term):
            offset += sign * (second if angle.text == PLUS else -second)
            angle = first
        elif angle.text == LESS and not isinstance(first, Term):
            offset, sign, angle = offset + sign * first, -sign, second
        else:
            return sign, angle, offset


def another_turn_helps(lower: float, upper: float) -> bool:
    """Return whether an angle in [-pi, pi] may be inside the limits [rad] after a whole turn.

    It can only be beyond one limit then, and the other one beyond a half turn.
    """
    slack = tolerances.LIMIT_SLACK
    return (lower <= slack - math.pi) != (upper >= math.pi - slack)
