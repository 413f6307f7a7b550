"""Episodes, and the messages on ``/episodes`` that describe them.

Every message describes its episode completely, so the last one of each number counts.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from typing import Annotated

import msgspec
from msgspec import Meta

from katana450.errors import InputError
from katana450.server.api.episode_requests import MAX_NUMBER

MAX_TIME = 1e12
"""[s] Bound of the times, so that none is infinite."""

Moment = Annotated[float, Meta(gt=-MAX_TIME, lt=MAX_TIME)]


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


class EpisodeGiver(msgspec.Struct, frozen=True):
    """The person or program that began an episode.

    Attributes:
        name: display name.
        role: role on the server.
    """

    name: str = ""
    role: str = ""


class Episode(msgspec.Struct, frozen=True):
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

    number: Annotated[int, Meta(ge=1, le=MAX_NUMBER)]
    task: str
    start: Moment
    end: Moment | None
    outcome: EpisodeOutcome
    note: str
    by: EpisodeGiver
    # Descriptions of earlier versions lack it.
    missing_ticks: Annotated[int, Meta(ge=0)] = 0

    def __post_init__(self) -> None:
        name = f"Episode {self.number}"
        if self.end is None and self.outcome is not EpisodeOutcome.RUNNING:
            raise InputError(f"{name} has the outcome {self.outcome.value} and no end.")
        if self.end is not None and self.end < self.start:
            raise InputError(
                f"{name} ends at {self.end:g} s, before its start at {self.start:g} s."
            )

    @property
    def length(self) -> float:
        """Time from begin to end [s]; 0 while it has no end."""
        return 0.0 if self.end is None else self.end - self.start


class EpisodeMessage(Episode, frozen=True, kw_only=True):
    """Description of an episode; the last one of each number counts.

    Attributes:
        t: time of the message [s] on the clock of the recording.
        kind: begun, ended, judged, noted, trimmed, discarded, restored or unfinished.
    """

    t: float
    kind: str


def message_of(episode: Episode, t: float, kind: str) -> EpisodeMessage:
    """Return the message at ``t`` [s] that describes ``episode``. ``kind``: what is reported."""
    return EpisodeMessage(**msgspec.structs.asdict(episode), t=t, kind=kind)


def episode_of(data: bytes | str) -> Episode:
    """Return the episode that the JSON text ``data`` describes. Raises InputError."""
    try:
        return msgspec.json.decode(data, type=Episode)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise InputError(f"The description of an episode is wrong: {error}.") from error


def episodes_of(messages: Iterable[bytes | str]) -> tuple[Episode, ...]:
    """Return the episodes that ``messages`` describe, by number. Raises InputError.

    messages: JSON texts in the order of the recording; the last one of each number counts.
    """
    episodes = {episode.number: episode for episode in map(episode_of, messages)}
    return tuple(episodes[number] for number in sorted(episodes))
