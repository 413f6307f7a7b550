"""Spans of a recording, one after the other on one axis of time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import content_of
from katana450.extensions.recording.files.table import TICK
from katana450.extensions.recording.messages import EVENTS

MAX_PAUSE = 2.0
"""[s] Time without a record from which on a new span begins."""

OWN_RUN = ("", "ring")
"""Recordings that a state of the same run is restored from."""


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


def lasting_spans(file: RecordingFile, start: float, end: float) -> tuple[Span, ...]:
    """Return the spans of the part from ``start`` to ``end`` [s] that lead to its last state.

    Where the arm was set back to a moment of the same run, what came after that moment is left
    out. Where it was set to a state of another run, or to one before the part, all that came
    before is left out. Raises InputError.
    """
    events = [content_of(message, dict) for message in file.messages(EVENTS)]
    spans: list[Span] = []
    for event in reversed([event for event in events if event.get("kind") == "restore"]):
        t, since = float(event["t"]), float(event["since"])
        if not start < t < end:
            continue
        spans.append(Span(t, end))
        # The first tick of the new run is the one after that state.
        end = since + TICK if event["recording"] in OWN_RUN else start
        if not start < end < t:
            return tuple(reversed(spans))
    return (Span(start, end), *reversed(spans))
