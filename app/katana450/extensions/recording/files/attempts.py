"""The tree of attempts: the parts of a recording between two continuations from earlier moments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest

import msgspec
from msgspec.structs import replace

from katana450.arm.control.commands.motion_commands import OWN_RUN
from katana450.arm.control.lease import CommandChannel
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.files.spans import Span
from katana450.extensions.recording.files.table import TICK
from katana450.extensions.recording.messages import EVENTS
from katana450.server.api.episode_requests import Judgement

RESTORE, DRIVER, ATTEMPT = "restore", "driver", "attempt"
"""Kinds of the events that make the tree: a continuation, a change of driver, a description."""

PERSON, PROGRAM, POLICY = "person", "program", "policy"
"""Sources of motion: a person at a page, a script, and a client of the API such as a policy."""


def source_of(channel: CommandChannel) -> str:
    """Return the source of motions that are commanded by ``channel``."""
    if channel in (CommandChannel.PAGE, CommandChannel.SCENE):
        return PERSON
    return PROGRAM if channel is CommandChannel.PROGRAM else POLICY


class TreeEvent(msgspec.Struct, frozen=True):
    """The fields of the events that make the tree; each kind has some of them.

    Attributes:
        t: time of the event [s].
        kind: RESTORE, DRIVER or ATTEMPT.
        since: time of the state that was restored, or a moment of the described attempt [s].
        recording: the recording of that state.
        name: name of the driver, or of the attempt.
        channel: channel of the driver.
        outcome: outcome of the attempt.
        hidden: whether the attempt is left out of lists.
    """

    t: float
    kind: str
    since: float = math.nan
    recording: str = ""
    name: str = ""
    channel: CommandChannel = CommandChannel.PAGE
    outcome: Judgement = "unjudged"
    hidden: bool = False


class Attempt(msgspec.Struct, frozen=True):
    """The part of a run between two continuations.

    Attributes:
        number: its number, from 1, in the order of time.
        parent: number of the attempt that contains the moment it continued from; None if that is
            not in the recording.
        start: time of its first tick [s].
        end: time of its last tick [s].
        since: the moment it continued from [s]; None without a parent.
        path: the spans that lead to its end, from that of its root.
        drivers: those who drove the arm, each with name and source.
        name: name that a person has given.
        outcome: ``unjudged``, ``success`` or ``failure``.
        hidden: whether a person has taken it out of lists.
    """

    number: int
    parent: int | None
    start: float
    end: float
    since: float | None = None
    path: tuple[Span, ...] = ()
    drivers: tuple[tuple[str, str], ...] = ()
    name: str = ""
    outcome: str = "unjudged"
    hidden: bool = False


def tree_events(messages: Iterable[Message]) -> Iterator[TreeEvent]:
    """Yield the events among ``messages`` that make the tree; damaged ones are left out."""
    for message in messages:
        try:
            event = msgspec.json.decode(message.data, type=TreeEvent)
        except (msgspec.MsgspecError, UnicodeError, RecursionError):
            continue
        if event.kind in (RESTORE, DRIVER, ATTEMPT):
            yield event


def tree_of(events: Iterable[TreeEvent], start: float, end: float) -> list[Attempt]:
    """Return the attempts from ``start`` to ``end`` [s], in the order of time."""
    attempts = [Attempt(1, None, start, end)]
    by_time = sorted(events, key=lambda event: event.t)
    for event in by_time:
        if event.kind != RESTORE or not start < event.t <= end:
            continue
        new = Attempt(len(attempts) + 1, None, event.t, end)
        if event.recording in OWN_RUN and start <= event.since < event.t:
            parent = attempt_at(attempts, event.since).number
            new = replace(new, parent=parent, since=event.since)
        before = attempts[-1]
        attempts[-1] = replace(before, end=max(event.t - TICK, before.start))
        attempts.append(new)
    drivers = [event for event in by_time if event.kind == DRIVER]
    for event, after in zip_longest(drivers, drivers[1:]):
        until = math.inf if after is None else after.t
        for index, attempt in enumerate(attempts):
            if event.t <= attempt.end and until > attempt.start:
                driver = event.name, source_of(event.channel)
                names = dict.fromkeys((*attempt.drivers, driver))
                attempts[index] = replace(attempt, drivers=tuple(names))
    for event in by_time:
        if event.kind == ATTEMPT and event.since >= start:
            index = attempt_at(attempts, event.since).number - 1
            attempts[index] = replace(
                attempts[index], name=event.name, outcome=event.outcome, hidden=event.hidden
            )
    return [replace(attempt, path=path_to(attempts, start, attempt.end)) for attempt in attempts]


def attempt_at(attempts: Sequence[Attempt], t: float) -> Attempt:
    """Return the one of ``attempts`` that was under way at ``t`` [s]; the first one before all."""
    return next((attempt for attempt in reversed(attempts) if attempt.start <= t), attempts[0])


def path_to(attempts: Sequence[Attempt], start: float, end: float) -> tuple[Span, ...]:
    """Return the spans from ``start`` on that lead to the state at ``end`` [s].

    Where the arm was set back to a moment of the same run, what came after that moment is left
    out. Where it was set to a state of another run, or to one before ``start``, all that came
    before is left out.
    """
    spans: list[Span] = []
    # An attempt that begins at the end has no part in it.
    attempt = attempt_at(attempts, math.nextafter(end, -math.inf))
    while attempt.start > start:
        spans.append(Span(attempt.start, end))
        if attempt.parent is None or attempt.since is None:
            return tuple(reversed(spans))
        # The first tick of the new attempt is the one after that state.
        end = attempt.since + TICK
        if not start < end < attempt.start:
            return tuple(reversed(spans))
        attempt = attempts[attempt.parent - 1]
    return (Span(start, end), *reversed(spans))


def lasting_spans(file: RecordingFile, start: float, end: float) -> tuple[Span, ...]:
    """Return the spans of the part of ``file`` from ``start`` to ``end`` [s]; see ``path_to``."""
    events = tree_events(file.messages(EVENTS))
    return path_to(tree_of(events, file.start, file.end), start, end)


def parted(
    first: Sequence[Span], second: Sequence[Span]
) -> tuple[tuple[Span, ...], tuple[Span, ...]]:
    """Return both paths without the spans that they share at their beginnings."""
    common = 0
    while common < min(len(first), len(second)) and first[common] == second[common]:
        common += 1
    rest, other = list(first[common:]), list(second[common:])
    if rest and other and rest[0].start == other[0].start:
        split = min(rest[0].end, other[0].end)
        for spans in (rest, other):
            spans[0] = Span(split, spans[0].end)
            if not spans[0].length:
                del spans[0]
    return tuple(rest), tuple(other)
