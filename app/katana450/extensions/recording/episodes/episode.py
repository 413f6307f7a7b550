"""Episodes, the messages on ``/episodes`` that describe them, and the requests about them.

Every message describes its episode completely, so the last one of each number counts. Requests are
JSON objects whose ``do`` names the request.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from katana450.errors import InputError

MAX_TASK_LENGTH, MAX_NOTE_LENGTH = 200, 500
"""Maximum lengths of the texts of an episode."""

MAX_NUMBER = 10**9

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
        key: pseudonym, the same as in the commands of the recording.
    """

    name: str = ""
    role: str = ""
    key: str = ""


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


MAX_REQUEST_BYTES = 8192
"""Maximum size of a request [bytes]."""

Number = Annotated[int, Meta(ge=1, le=MAX_NUMBER)]
Task = Annotated[str, Meta(max_length=MAX_TASK_LENGTH)]
Remark = Annotated[str, Meta(max_length=MAX_NOTE_LENGTH)]
Judgement = Literal["unjudged", "success", "failure"]


class EpisodeRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="do"
):
    """Base of the requests about episodes."""


class StartEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="start"):
    """Begin an episode.

    Attributes:
        task: What is to be done; None for that of the last episode.
    """

    task: Task | None = None


class StopEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="stop"):
    """End the episode that runs, and keep it in its file.

    Attributes:
        outcome: Its outcome, if it is known already.
        number: The episode; another one that runs is not ended. None for any.
    """

    outcome: Judgement = "unjudged"
    number: Number | None = None


class JudgeEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="judge"):
    """Judge an episode. One that runs is ended first.

    Attributes:
        number: The episode; None for the one that runs, or else the last one.
        outcome: The outcome.
    """

    number: Number | None = None
    outcome: Judgement


class DiscardEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="discard"):
    """Move an episode to the discarded ones. One that runs is ended first.

    Attributes:
        number: The episode; None for the one that runs, or else the last one.
    """

    number: Number | None = None


class RestoreEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="restore"):
    """Bring a discarded episode back.

    Attributes:
        number: The episode.
    """

    number: Number


class UndoEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="undo"):
    """Undo the last judgement, discard or re-record, up to 10 s after it.

    Attributes:
        number: The episode; what was done to another one since is not undone. None for any.
    """

    number: Number | None = None


class RerecordEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="rerecord"):
    """Begin an episode again. When the new one is kept, the old one is discarded.

    Attributes:
        number: The old episode; None for the one that runs, or else the last one. One that runs is
            ended first.
    """

    number: Number | None = None


class DescribeEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="describe"):
    """Change the texts of an episode.

    Attributes:
        number: The episode.
        task: The new task; None to keep it.
        note: The new remarks; None to keep them.
    """

    number: Number
    task: Task | None = None
    note: Remark | None = None


class TrimEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="trim"):
    """Give an episode another start and end. Nothing is deleted, so it can be widened again.

    Attributes:
        number: The episode.
        start: First moment, in seconds after the start of its file.
        end: Last moment, in seconds after the start of its file.
    """

    number: Number
    start: Annotated[float, Meta(ge=0.0)]
    end: Annotated[float, Meta(ge=0.0)]


AnyEpisodeRequest = (
    StartEpisode
    | StopEpisode
    | JudgeEpisode
    | DiscardEpisode
    | RestoreEpisode
    | UndoEpisode
    | RerecordEpisode
    | DescribeEpisode
    | TrimEpisode
)

_decoder: msgspec.json.Decoder[Any] = msgspec.json.Decoder(AnyEpisodeRequest)


def episode_request(text: bytes | str) -> AnyEpisodeRequest:
    """Return the request in the JSON ``text``. Raises InputError with the reason if it is wrong."""
    try:
        request: AnyEpisodeRequest = _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise InputError(f"This is not a valid request about episodes: {error}.") from error
    return request
