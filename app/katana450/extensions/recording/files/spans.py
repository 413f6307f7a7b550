"""Spans of a recording, one after the other on one axis of time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

MAX_PAUSE = 2.0
"""[s] Time without a record from which on a new span begins."""


class Span(NamedTuple):
    """A time with records, from ``start`` to ``end`` [s]."""

    start: float
    end: float

    @property
    def length(self) -> float:
        """Its length [s]."""
        return self.end - self.start


def spans_of(parts: Iterable[tuple[float, float]]) -> tuple[Span, ...]:
    """Return the spans that ``parts``, each with begin and end [s], form in their order."""
    spans: list[Span] = []
    for start, end in sorted(parts):
        if spans and start - spans[-1].end <= MAX_PAUSE:
            spans[-1] = Span(spans[-1].start, max(spans[-1].end, end))
        else:
            spans.append(Span(start, end))
    return tuple(spans)


def at_place(spans: Sequence[Span], place: float) -> float:
    """Return the time [s] at ``place`` [s] of the axis; that of the nearer end beyond it."""
    for span in spans:
        if place <= span.length:
            return span.start + max(place, 0.0)
        place -= span.length
    return spans[-1].end if spans else 0.0


def length_of(spans: Iterable[Span]) -> float:
    """Return the length [s] of the axis."""
    return sum(span.length for span in spans)
