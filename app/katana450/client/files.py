"""Files, STOP and episodes of a server, over HTTP."""

from __future__ import annotations

import urllib.error
import urllib.request
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar
from urllib.parse import urlencode, urlsplit

import msgspec

from katana450.atomic import write_files, writer_of
from katana450.client.acts import EpisodeActs
from katana450.errors import KatanaError
from katana450.server.api import answers
from katana450.server.api.episode_requests import EpisodeRequest
from katana450.server.api.fields import ROOT

STOP_TIMEOUT = 2.0
"""[s] Timeout of a STOP on one path."""

REQUEST_TIMEOUT = 60.0
"""[s] Timeout of a transfer."""


Answer = TypeVar("Answer")


class RefusedError(KatanaError):
    """The server refused the request; the message says why, and what to do.

    Attributes:
        retry: time after which the same request can be accepted [s]; None if only another one can.
    """

    def __init__(self, why: str, retry: float | None = None) -> None:
        super().__init__(why)
        self.retry = retry


class LostError(KatanaError):
    """The connection to the server is lost. A moving arm is then stopped."""


@dataclass(frozen=True)
class Site:
    """The address of the server, the token of an access link if it requires one, and our name."""

    url: str
    token: str = ""
    name: str = "Program"

    def answered(self, path: str, data: bytes, kind: type[Answer]) -> Answer:
        """Return the answer of ``kind`` to ``data``. Raises RefusedError or LostError."""
        answer = answers.decoded(self.fetched(path, data))
        assert isinstance(answer, kind)
        return answer

    def stop(self, press: str, port: int | None = None) -> str:
        """Send STOP over HTTP; return whether the arm has ``confirmed`` it, or ``requested``.

        Args:
            press: name of the press, which counts once on all paths.
            port: port that serves STOP alone; None for that of the server.

        Raises:
            RefusedError: the server does not admit the program.
            LostError: nothing answers on this port.
        """
        site = self
        if port is not None:
            parts = urlsplit(self.url)
            host = f"[{parts.hostname}]" if ":" in (parts.hostname or "") else parts.hostname
            site = replace(self, url=f"{parts.scheme}://{host}:{port}")
        path = f"{ROOT}/stop?{urlencode({'press': press})}"
        content = site.fetched(path, b"", STOP_TIMEOUT)
        # The server of STOP alone answers with the stage.
        return str(msgspec.json.decode(content)["stop"]) if content else "requested"

    def fetched(
        self, path: str, data: bytes | None = None, timeout: float = REQUEST_TIMEOUT
    ) -> bytes:
        """Return the content at ``path``, the answer to ``data`` if that is sent.

        Raises RefusedError or LostError.
        """
        # A header has no other characters.
        headers = {"X-Name": self.name if self.name.isascii() else "Program"}
        if self.token:
            headers["Authorization"] = f"Bearer {self.token}"
        request = urllib.request.Request(self.url.rstrip("/") + path, data=data, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=timeout) as answer:
                content: bytes = answer.read()
                return content
        except urllib.error.HTTPError as error:
            with error:
                raise RefusedError(_why(error.read())) from error
        except OSError as error:
            raise LostError(f"There is no katana450 server at {self.url}: {error}.") from error


def _why(content: bytes) -> str:
    try:
        refused = answers.decoded(content)
    except msgspec.MsgspecError:
        return content.decode("utf-8", "replace")
    return refused.why if isinstance(refused, answers.Refused) else str(refused)


PATH = f"{ROOT}/episodes"


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


class _Done(msgspec.Struct):
    number: int


class EpisodeClient(EpisodeActs):
    """Records and judges the episodes of a server, by a method for each request about them.

    Each method waits for the answer; an asyncio program calls it by ``asyncio.to_thread``. Raises
    RefusedError with the reason if the server refuses, and LostError if there is no server, or its
    answer is not understood.
    """

    def __init__(self, site: Site) -> None:
        self._site = site

    def list(self) -> tuple[ListedEpisode, ...]:
        """Return the kept episodes, by number."""
        return tuple(_understood(self._site.fetched(PATH), _List).episodes)

    def ask(self, request: EpisodeRequest) -> int:
        """Send ``request``; return the number of its episode; 0 for one about an attempt."""
        content = self._site.fetched(PATH, msgspec.json.encode(request))
        return _understood(content, _Done).number

    def download(self, number: int, out: Path) -> None:
        """Write the file of the kept episode ``number`` to ``out``."""
        content = self._site.fetched(f"{PATH}/{number}")
        write_files({out: writer_of(content)})


def _understood(content: bytes, kind: type[Answer]) -> Answer:
    """Return the answer ``content`` of a server. Raises LostError if it is not of ``kind``."""
    try:
        return msgspec.json.decode(content, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise LostError(
            f"The answer about episodes is not understood: {error}. Is the server of the same "
            "version?"
        ) from error
