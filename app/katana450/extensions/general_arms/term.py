"""The numbers of a function that is written out: terms, and the blocks in which they are computed.

A term remembers how it is computed. Products with 0 and 1 vanish, and a minus sign moves outwards,
so that terms which differ by their sign alone are computed once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from katana450.extensions.general_arms.functions import Number

if TYPE_CHECKING:
    from katana450.extensions.general_arms.straight_line import TermList

PLUS, LESS, MINUS, TIMES = "({0} + {1})", "({0} - {1})", "(-{0})", "({0} * {1})"
LESS_EQUAL, BELOW, ABOVE = "({0} <= {1})", "({0} < {1})", "({0} > {1})"
COMPARISONS: Final = (LESS_EQUAL, BELOW, ABOVE)

Span = tuple[float, float]

NO_SPAN: Final[Span] = (-math.inf, math.inf)


class Term:
    """A number that the function computes.

    Attributes:
        owner: list of all terms of the function.
        text: its text with a place for each argument.
        arguments: terms and numbers.
        number: counts the terms.
        span: between which numbers it lies.
        forked: the fork that computes it, and its place among the values there; None for others.
    """

    # numpy leaves products with its numbers to this class.
    __array_ufunc__ = None
    __slots__ = ("arguments", "forked", "number", "owner", "span", "text")

    def __init__(
        self, owner: TermList, text: str, arguments: tuple[Number, ...], number: int, span: Span
    ) -> None:
        self.owner = owner
        self.text = text
        self.arguments = arguments
        self.number = number
        self.span = span
        self.forked: tuple[Fork, int] | None = None

    def __add__(self, other: Number) -> Number:
        if _is(other, 0.0):
            return self
        if has(other, MINUS):
            return self - other.arguments[0]
        if self.text == MINUS:
            return other - self.arguments[0]
        if not isinstance(other, Term) and self.text in (PLUS, LESS):
            # Two numbers become one.
            first, second = self.arguments
            if not isinstance(second, Term):
                return first + (other + second if self.text == PLUS else other - second)
            if not isinstance(first, Term):
                return (first + other) - second
        (a, b), (c, d) = self.span, span_of(other)
        return self.owner.term(PLUS, *_ordered(self, other), span=(a + c, b + d))

    def __radd__(self, other: Number) -> Number:
        return self + other

    def __sub__(self, other: Number) -> Number:
        if _is(other, 0.0):
            return self
        if has(other, MINUS):
            return self + other.arguments[0]
        if self.text == MINUS:
            return -(self.arguments[0] + other)
        if not isinstance(other, Term) and self.text in (PLUS, LESS):
            return self + -other
        (a, b), (c, d) = self.span, span_of(other)
        return self.owner.term(LESS, self, other, span=(a - d, b - c))

    def __rsub__(self, other: Number) -> Number:
        if other == 0.0:
            return -self
        if self.text == MINUS:
            return self.arguments[0] + other
        a, b = self.span
        return self.owner.term(LESS, other, self, span=(other - b, other - a))

    def __mul__(self, other: Number) -> Number:
        if not isinstance(other, Term):
            return other * self
        if self.text == MINUS:
            return -(self.arguments[0] * other)
        if other.text == MINUS:
            return -(self * other.arguments[0])
        return self.owner.term(TIMES, *_ordered(self, other))

    def __rmul__(self, other: Number) -> Number:
        if other == 0.0:
            return 0.0
        if abs(other) == 1.0:
            return self if other > 0.0 else -self
        if other < 0.0:
            return -(-other * self)
        if self.text == MINUS:
            return -(other * self.arguments[0])
        return self.owner.term(
            TIMES, other, self, span=(other * self.span[0], other * self.span[1])
        )

    def __truediv__(self, other: Number) -> Number:
        if self.text == MINUS:
            return -(self.arguments[0] / other)
        if has(other, MINUS):
            return -(self / other.arguments[0])
        return self.owner.term("({0} / {1})", self, other)

    def __rtruediv__(self, other: Number) -> Number:
        if other == 0.0:
            return 0.0
        if self.text == MINUS:
            return -(other / self.arguments[0])
        return self.owner.term("({0} / {1})", other, self)

    def __neg__(self) -> Number:
        if self.text == MINUS:
            return self.arguments[0]
        if self.text == LESS:
            first, second = self.arguments
            return second - first
        if self.text == PLUS and not isinstance(self.arguments[1], Term):
            return -self.arguments[1] - self.arguments[0]
        return self.owner.term(MINUS, self, span=(-self.span[1], -self.span[0]))

    def __abs__(self) -> Number:
        return self.owner.term("abs({0})", self, span=(0.0, math.inf))

    def __le__(self, other: Number) -> Number:
        return self.owner.term(LESS_EQUAL, self, other)

    def __lt__(self, other: Number) -> Number:
        return self.owner.term(BELOW, self, other)

    def __gt__(self, other: Number) -> Number:
        return self.owner.term(ABOVE, self, other)

    def __or__(self, other: Number) -> Number:
        return self.owner.term("({0} or {1})", self, other)

    def __and__(self, other: Number) -> Number:
        return self.owner.term("({0} and {1})", self, other)


@dataclass(frozen=True, eq=False)
class Need:
    """Conditions without which the function returns None."""

    conditions: tuple[Term, ...]


@dataclass(frozen=True, eq=False)
class TermBlock:
    """Lines of the function.

    Attributes:
        items: what it computes, in the order in which it was made.
        known: its terms by their text and arguments.
    """

    items: list[Term | Fork | Need] = field(default_factory=list)
    known: dict[tuple[object, ...], Term] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Fork:
    """Values that are computed in one of two ways.

    Attributes:
        condition: decides between them; the first way is taken where it holds.
        rare: the index of the way that is rarely taken.
        path: the blocks around the fork, from the outermost.
        blocks: the terms that only one of the ways needs.
        values: the values of each way.
        terms: the values as the rest of the function sees them.
    """

    condition: Term
    rare: int
    path: tuple[TermBlock, ...]
    blocks: tuple[TermBlock, TermBlock] = field(default_factory=lambda: (TermBlock(), TermBlock()))
    values: tuple[list[Number], list[Number]] = field(default_factory=lambda: ([], []))
    terms: list[Term] = field(default_factory=list)


def has(value: Number, text: str) -> bool:
    """Return whether ``value`` is a term with this text."""
    return isinstance(value, Term) and value.text == text


def span_of(value: Number) -> Span:
    """Return between which numbers ``value`` lies."""
    return value.span if isinstance(value, Term) else (float(value), float(value))


def _is(value: Number, number: float) -> bool:
    return not isinstance(value, Term) and bool(value == number)


def _ordered(a: Term, b: Number) -> tuple[Number, Number]:
    """Return the arguments of a sum or product in one order, as it does not matter."""
    return (b, a) if isinstance(b, Term) and b.number < a.number else (a, b)
