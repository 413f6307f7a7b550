"""Episodes of a server, for programs: record, judge and list them. Every call is over HTTP."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import msgspec

from katana450.atomic import write_files, writer_of
from katana450.client.files import LostError, RefusedError, Site
from katana450.server.api.fields import ROOT

PATH = f"{ROOT}/episodes"

Answer = TypeVar("Answer")


class ListedEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """An episode in the list of a server.

    Attributes:
        number: Its number.
        task: What is to be done.
        outcome: ``success``, ``failure``, ``unjudged``, or ``unfinished`` after a crash.
        note: Remarks.
        start: First moment [s] after the start of its file.
        end: Last moment [s] after the start of its file.
        recorded: Length of its file [s], which bounds both.
        bytes: Length of its file [bytes].
        file: Name of its file.
        missing_ticks: Number of its ticks, of 10 ms each, that could not be recorded.
    """

    number: int
    task: str
    outcome: str
    note: str
    start: float
    end: float
    recorded: float
    bytes: int
    file: str
    missing_ticks: int = 0


class _List(msgspec.Struct):
    episodes: list[ListedEpisode]
    discarded: list[ListedEpisode]
    folder: str


class _Done(msgspec.Struct):
    number: int


class EpisodeClient:
    """Records and judges the episodes of a server.

    Each method waits for the answer; an asyncio program calls it by ``asyncio.to_thread``. Raises
    RefusedError with the reason if the server refuses, and LostError if there is no server, or its
    answer is not understood.
    """

    def __init__(self, site: Site) -> None:
        self._site = site

    def list(self) -> tuple[ListedEpisode, ...]:
        """Return the kept episodes, by number."""
        return tuple(self._listed().episodes)

    def discarded(self) -> tuple[ListedEpisode, ...]:
        """Return the discarded episodes, by number."""
        return tuple(self._listed().discarded)

    def folder(self) -> Path:
        """Return the folder of the episodes, on the machine of the server.

        Raises RefusedError for a client that may only watch.
        """
        folder = self._listed().folder
        if not folder:
            raise RefusedError("Your role may watch, but not see where the files are.")
        return Path(folder)

    def start(self, task: str | None = None) -> int:
        """Begin an episode and return its number. ``task``: None for that of the last one."""
        return self._number({"do": "start", "task": task})

    def stop(self, outcome: str = "unjudged", number: int | None = None) -> int:
        """End the episode that runs and return its number.

        Args:
            outcome: unjudged, success or failure.
            number: the episode, so that no other one is ended; None for any.
        """
        return self._number({"do": "stop", "outcome": outcome, "number": number})

    def judge(self, outcome: str, number: int | None = None) -> int:
        """Judge an episode and return its number.

        Args:
            outcome: unjudged, success or failure.
            number: the episode; None for the one that runs, which then ends, or else the last one.
        """
        return self._number({"do": "judge", "outcome": outcome, "number": number})

    def discard(self, number: int | None = None) -> int:
        """Discard an episode and return its number; see ``judge``."""
        return self._number({"do": "discard", "number": number})

    def restore(self, number: int) -> int:
        """Bring the discarded episode ``number`` back; return ``number``."""
        return self._number({"do": "restore", "number": number})

    def undo(self, number: int | None = None) -> int:
        """Undo the last judgement, discard or re-record, up to 10 s after it; return its number.

        ``number``: the episode, so that nothing else is undone; None for any.
        """
        return self._number({"do": "undo", "number": number})

    def rerecord(self, number: int | None = None) -> int:
        """Begin an episode again and return the new number; see ``judge``.

        The old one is discarded when the new one is kept.
        """
        return self._number({"do": "rerecord", "number": number})

    def describe(self, number: int, *, task: str | None = None, note: str | None = None) -> int:
        """Change the texts of the episode ``number``; None keeps one. Return ``number``."""
        return self._number({"do": "describe", "number": number, "task": task, "note": note})

    def trim(self, number: int, start: float, end: float) -> int:
        """Give the episode ``number`` another start and end [s after the start of its file].

        Nothing is deleted. Returns ``number``.
        """
        return self._number({"do": "trim", "number": number, "start": start, "end": end})

    def download(self, number: int, out: Path) -> None:
        """Write the file of the kept episode ``number`` to ``out``."""
        content = self._site.fetched(f"{PATH}/{number}")
        write_files({out: writer_of(content)})

    def _listed(self) -> _List:
        return _understood(self._site.fetched(PATH), _List)

    def _number(self, request: dict[str, Any]) -> int:
        return _understood(self._site.fetched(PATH, msgspec.json.encode(request)), _Done).number


def _understood(content: bytes, kind: type[Answer]) -> Answer:
    """Return the answer ``content`` of a server. Raises LostError if it is not of ``kind``."""
    try:
        return msgspec.json.decode(content, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise LostError(
            f"The answer about episodes is not understood: {error}. Is the server of the same "
            "version?"
        ) from error
