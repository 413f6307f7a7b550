"""Differences of two attempts after the moment at which they part: measures, and their ends."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.extensions.programs.script.measures import (
    motion_measures,
    title_of,
    unit_of,
    water_measures,
)
from katana450.extensions.recording.files.spans import Span, length_of
from katana450.extensions.recording.messages import StateRow
from katana450.maths.kinematics.forward import forward

MAX_OBJECTS = 5
"""Number of objects whose places are compared: those that are furthest apart."""

SAME = 1e-4
"""[m] Distance below which an object is at the same place."""


class AttemptResult(NamedTuple):
    """An attempt: its spans after the parting, states in these, and the state at its end."""

    spans: tuple[Span, ...]
    rows: Sequence[StateRow]
    end: State


class AttemptDifference(msgspec.Struct, frozen=True):
    """The comparison of two attempts.

    Attributes:
        starts: the moments [s since the epoch] at which they part; None for one that ends there.
        rows: for each measure its name, and its values in both with their unit. Then what is
            elsewhere at their ends, and how far it is apart.
    """

    starts: tuple[float | None, float | None]
    rows: list[tuple[str, str, str]]


def difference(session: Session, first: AttemptResult, second: AttemptResult) -> AttemptDifference:
    """Return the comparison of two attempts of the robot of ``session``."""
    values, others = (dict(_measures(session, result)) for result in (first, second))
    rows = [
        (title_of(name), values.get(name, "–"), others.get(name, "–"))
        for name in {**values, **others}
    ]
    apart = [
        (f"Ends apart: {name}", "", words) for name, words in _apart(session, first.end, second.end)
    ]
    return AttemptDifference((_start(first), _start(second)), rows + apart)


def _start(result: AttemptResult) -> float | None:
    return result.spans[0].start if result.spans else None


def _measures(session: Session, result: AttemptResult) -> Iterator[tuple[str, str]]:
    """Yield name and value of each measure of ``result``, with its unit."""
    values: Mapping[str, float] = {"duration_s": length_of(result.spans)}
    rows, arm, poured = result.rows, session.arm, result.end.poured
    if arm is not None and rows:
        q, qd = (np.array([getattr(row, name) for row in rows]) for name in ("joints", "qd"))
        values = {**values, **motion_measures(arm, [row.tool for row in rows], q, qd)}
    if poured is not None:
        values = {**values, **water_measures(poured.water, poured.course)}
    for name, value in values.items():
        if np.isfinite(value):
            yield name, f"{value:.3g} {unit_of(name)}".replace(" deg", "°").rstrip()


def _apart(session: Session, first: State, second: State) -> Iterator[tuple[str, str]]:
    """Yield what is elsewhere in two states: the joint that differs most, tool and objects."""
    angles = np.abs(first.q - second.q)
    joint = int(angles.argmax())
    if session.arm is not None:
        ends = [forward(session.arm.chain_to(state.tool), state.q) for state in (first, second)]
        yield f"joint {joint + 1}", f"{np.degrees(angles[joint]):.1f}°"
        yield "tool", f"{1e3 * np.linalg.norm(ends[0][:3, 3] - ends[1][:3, 3]):.1f} mm"
    places = [
        {body.name: session.environment.pose(body, state.x)[:3, 3] for body in state.objects}
        for state in (first, second)
    ]
    moved = [
        (float(np.linalg.norm(place - places[1][name])), name)
        for name, place in places[0].items()
        if name in places[1]
    ]
    for distance, name in sorted(moved, reverse=True)[:MAX_OBJECTS]:
        if distance > SAME:
            yield name, f"{1e3 * distance:.1f} mm"
