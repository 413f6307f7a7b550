"""Requests about episodes, for the server that records them and for its clients.

They are JSON objects whose ``do`` names the request.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from katana450.errors import InputError

MAX_TASK_LENGTH, MAX_NOTE_LENGTH = 200, 500
"""Maximum lengths of the texts of an episode."""

MAX_NUMBER = 10**9
"""Maximum number of an episode."""

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
        outcome: The outcome.
        number: The episode; None for the one that runs, or else the last one.
    """

    outcome: Judgement
    number: Number | None = None


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


class RerecordEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="rerecord"):
    """Discard an episode, and begin another one with the same task.

    Attributes:
        number: The old episode; None for the one that runs, or else the last one. One that runs is
            ended first.
    """

    number: Number | None = None


class KeepEpisode(EpisodeRequest, frozen=True, kw_only=True, tag="keep"):
    """Keep a part of the last minutes, as a correction after a failure, as an episode.

    Attributes:
        start: Its first moment, as the timeline counts [s since the epoch].
        end: Its last moment [s since the epoch].
        outcome: Its outcome.
        task: What was done; None for that of the last episode.
    """

    start: float
    end: float
    outcome: Judgement = "success"
    task: Task | None = None


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


class DescribeAttempt(EpisodeRequest, frozen=True, kw_only=True, tag="describe_attempt"):
    """Name or judge an attempt of the last minutes, or take it out of the list.

    Attributes:
        t: A moment of the attempt, as the timeline counts [s since the epoch].
        name: Its name; empty for none.
        outcome: Its outcome.
        hidden: Whether lists leave it out. Nothing is deleted.
    """

    t: float
    name: Task = ""
    outcome: Judgement = "unjudged"
    hidden: bool = False


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
    | RerecordEpisode
    | KeepEpisode
    | DescribeEpisode
    | DescribeAttempt
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
