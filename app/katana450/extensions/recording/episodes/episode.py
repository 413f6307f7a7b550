"""Episodes, and the messages on ``/episodes`` that describe them.

Every message describes its episode completely, so the last one of each number counts.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from katana450.errors import InputError

MAX_TASK_LENGTH, MAX_NOTE_LENGTH = 200, 500
"""Maximum lengths of the texts of an episode."""

MAX_NUMBER = 10**9


class EpisodeOutcome(Enum):
    """Result of an episode."""

    RUNNING = "running"
    """It has not ended."""
    UNJUDGED = "unjudged"
    """It has ended, and nobody has judged it yet."""
    SUCCESS = "success"
    FAILURE = "failure"
    UNFINISHED = "unfinished"
    """A crash has ended it."""


JUDGED = (EpisodeOutcome.SUCCESS, EpisodeOutcome.FAILURE)
"""Outcomes that a person has given."""


@dataclass(frozen=True)
class EpisodeGiver:
    """The person or program that began an episode.

    Attributes:
        name: display name.
        role: role on the server.
        key: pseudonym, the same as in the commands of the recording.
    """

    name: str
    role: str
    key: str


@dataclass(frozen=True)
class Episode:
    """A part of a recording that shows one attempt at a task.

    Attributes:
        number: number in its folder, from 1.
        task: what is to be done, in words; may be empty.
        start, end: first and last moment [s] on the clock of the recording; ``end`` is None while
            it runs.
        outcome: the result.
        note: remarks; may be empty.
        by: the person who began it.
        missing_ticks: number of its ticks that could not be recorded.
    """

    number: int
    task: str
    start: float
    end: float | None
    outcome: EpisodeOutcome
    note: str
    by: EpisodeGiver
    missing_ticks: int = 0

    @property
    def length(self) -> float:
        """Time from begin to end [s]; 0 while it has no end."""
        return 0.0 if self.end is None else self.end - self.start


def message_of(episode: Episode, t: float, kind: str) -> dict[str, Any]:
    """Return the message that describes ``episode``.

    Args:
        episode: the episode.
        t: time of the message [s] on the clock of the recording.
        kind: what is reported: begun, ended, judged, noted, trimmed, discarded, restored or
            unfinished.
    """
    by = episode.by
    return {
        "t": t,
        "kind": kind,
        "number": episode.number,
        "task": episode.task,
        "start": episode.start,
        "end": episode.end,
        "outcome": episode.outcome.value,
        "note": episode.note,
        "by": {"name": by.name, "role": by.role, "key": by.key},
        "missing_ticks": episode.missing_ticks,
    }


def episode_of(data: bytes | str) -> Episode:
    """Return the episode that the JSON text ``data`` describes. Raises InputError."""
    try:
        found = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"The description of an episode is no JSON: {error}.") from error
    if not isinstance(found, dict):
        raise InputError("The description of an episode is no JSON object.")
    by = found.get("by")
    by = by if isinstance(by, dict) else {}
    number = found.get("number")
    if not isinstance(number, int) or isinstance(number, bool) or not 1 <= number <= MAX_NUMBER:
        raise InputError(f"The number of an episode is {number!r}, not a whole number from 1.")
    try:
        outcome = EpisodeOutcome(found.get("outcome"))
    except ValueError as error:
        known = ", ".join(each.value for each in EpisodeOutcome)
        raise InputError(
            f"The outcome of episode {number} is {found.get('outcome')!r}, not one of {known}."
        ) from error
    start = _time(found, "start", number)
    end = None if found.get("end") is None else _time(found, "end", number)
    if end is None and outcome is not EpisodeOutcome.RUNNING:
        raise InputError(f"Episode {number} has the outcome {outcome.value} and no end.")
    if end is not None and end < start:
        raise InputError(f"Episode {number} ends at {end:g} s, before its start at {start:g} s.")
    # Descriptions of earlier versions lack it.
    missing = found.get("missing_ticks", 0)
    if not isinstance(missing, int) or isinstance(missing, bool) or missing < 0:
        raise InputError(f"The missing ticks of episode {number} are {missing!r}, not a number.")
    giver = EpisodeGiver(
        _text(by, "name", number), _text(by, "role", number), _text(by, "key", number)
    )
    return Episode(
        number,
        _text(found, "task", number),
        start,
        end,
        outcome,
        _text(found, "note", number),
        giver,
        missing,
    )


def episodes_of(messages: Iterable[bytes | str]) -> tuple[Episode, ...]:
    """Return the episodes that ``messages`` describe, by number. Raises InputError.

    messages: JSON texts in the order of the recording; the last one of each number counts.
    """
    found: dict[int, Episode] = {}
    for each in messages:
        episode = episode_of(each)
        found[episode.number] = episode
    return tuple(found[number] for number in sorted(found))


def _time(found: Mapping[str, Any], name: str, number: int) -> float:
    value = found.get(name)
    # A whole number of any size is valid JSON, so it is bounded before it becomes a float.
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < 1e12:
        raise InputError(f"The {name} of episode {number} is {value!r}, not a number of seconds.")
    return float(value)


def _text(found: Mapping[str, Any], name: str, number: int) -> str:
    value = found.get(name, "")
    if not isinstance(value, str):
        raise InputError(f"The {name} of episode {number} is {value!r}, not a text.")
    return value
