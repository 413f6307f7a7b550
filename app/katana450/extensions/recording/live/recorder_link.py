"""The connection between the page's server and the process that records.

The process that records listens in the private folder of the server. Requests about episodes and
notes of scripts go to it; answers and the state of the episodes come back.
"""

from __future__ import annotations

import logging
import threading
import time
import weakref
from contextlib import suppress
from itertools import count
from multiprocessing.connection import Connection
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

import msgspec

from katana450.arm.runtime.pipes.guarded_pipe import PIPE_ERRORS
from katana450.arm.runtime.pipes.private_listener import (
    Greeting,
    PrivateAddress,
    PrivateListener,
    Roles,
    connect,
)
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import EpisodeGiver
from katana450.extensions.recording.live.running_scripts import RunningScripts, ScriptNote
from katana450.server.api.episode_requests import AnyEpisodeRequest
from katana450.server.service.hub import Hub

if TYPE_CHECKING:
    from katana450.extensions.recording.episodes.keeper import EpisodeKeeper

IDLE_SECONDS = 60.0
"""[s] Maximum time between two states of the episodes while nothing changes."""

ACTIVE_SECONDS = 0.5
"""[s] Time between two states of the episodes while one runs."""

START_DELAY = 2.0
"""[s] Time in which the process that records is not yet ready."""

RECONNECT_SECONDS = 0.5
"""[s] Time between two attempts to reach the process that records."""

GREETING_SECONDS = 5.0
"""[s] Maximum time for which the page's server waits until the process that records greets it."""

ANSWER_SECONDS = 300.0
"""[s] Maximum time for which a request waits for its answer, such as the saving of an hour."""

MAX_MESSAGE_BYTES = 1_000_000

MAX_REPEATED = 20
"""Number of runs of scripts that are noted again by a process that records and has just started."""

ENTRY = "episodes"
"""Name of the state of episodes in the status of all pages."""

NOT_READY = (
    "The process that records is not ready. It starts a few seconds after the arm; try it again."
)
ENDED = "The process that records has ended. It is started again; look at the list of episodes."
SILENT = (
    f"The process that records has not answered for {ANSWER_SECONDS:g} s. Look at the list of "
    "episodes, and start the server again if this repeats."
)

log = logging.getLogger(__name__)


class GivenRequest(msgspec.Struct, frozen=True, tag="request"):
    """A request about episodes."""

    number: int
    request: AnyEpisodeRequest
    by: EpisodeGiver


class RequestAnswer(msgspec.Struct, frozen=True, tag="answer"):
    """The answer to the request ``number``: the episode, or the reason why it is refused."""

    number: int
    episode: dict[str, Any] | None = None
    why: str = ""


class EpisodesState(msgspec.Struct, frozen=True, tag="state"):
    """The state of the episodes for the pages."""

    state: dict[str, Any]


PAGE = "page"
"""Role of the page's server. There is one at a time: a new one replaces the one before."""


class RecorderListener:
    """Accepts the connection of the page's server in the process that records."""

    def __init__(
        self,
        keeper: EpisodeKeeper | InputError,
        scripts: RunningScripts,
        address: PrivateAddress,
    ) -> None:
        """Listen at ``address``. Raises OSError if it cannot be used.

        Args:
            keeper: executes the requests about episodes; the reason if there are none.
            scripts: takes the notes of scripts.
            address: address of this process.
        """
        self._keeper, self._scripts = keeper, scripts
        self._newest: Connection | None = None
        self._sending = threading.Lock()
        roles: Roles = {PAGE: self._serve}
        self._listener = PrivateListener(address, roles, "the process that records")
        self._listener.start()
        if not isinstance(keeper, InputError):
            threading.Thread(
                target=self._tick, args=(keeper,), name="episode clock", daemon=True
            ).start()

    def close(self) -> None:
        """Take no more requests."""
        self._listener.close()

    def _tick(self, keeper: EpisodeKeeper) -> None:
        """Let the keeper look at the time while an episode runs."""
        while True:
            keeper.wait(keeper.revision, ACTIVE_SECONDS if keeper.active else 5.0)
            try:
                keeper.tick()
            except Exception:
                # The next look must come, whatever happened.
                log.exception("The clock of the episodes met an error.")

    def _serve(self, connection: Connection, _greeting: Greeting) -> None:
        # The page's server before this one has ended, and with it what it ran.
        self._newest = connection
        self._scripts.end_all(time.perf_counter())
        self._in_thread(self._send_states, connection)
        decoder = msgspec.json.Decoder(GivenRequest | ScriptNote)
        try:
            while True:
                message = decoder.decode(connection.recv_bytes(MAX_MESSAGE_BYTES))
                if isinstance(message, ScriptNote):
                    self._scripts.note(message)
                else:
                    # So that the saving of a long episode delays no other request.
                    self._in_thread(self._answer, connection, message)
        finally:
            if self._newest is connection:
                self._scripts.end_all(time.perf_counter())

    def _in_thread(self, work: Any, *arguments: Any) -> None:
        threading.Thread(target=work, args=arguments, name="episode request", daemon=True).start()

    def _send(self, connection: Connection, message: msgspec.Struct) -> None:
        with self._sending:
            connection.send_bytes(msgspec.json.encode(message))

    def _send_states(self, connection: Connection) -> None:
        """Send the state whenever it changes, until the other end closes."""
        keeper = self._keeper
        if isinstance(keeper, InputError):
            return
        with suppress(*PIPE_ERRORS):
            while self._newest is connection:
                revision = keeper.revision
                self._send(connection, EpisodesState(keeper.status()))
                keeper.wait(revision, ACTIVE_SECONDS if keeper.active else IDLE_SECONDS)

    def _answer(self, connection: Connection, request: GivenRequest) -> None:
        try:
            if isinstance(self._keeper, InputError):
                raise self._keeper
            answer = RequestAnswer(request.number, self._keeper.handle(request.request, request.by))
        except InputError as error:
            answer = RequestAnswer(request.number, why=str(error))
        except Exception as error:
            log.exception("A request about an episode met an error.")
            why = f"The process that records met an error: {error}."
            answer = RequestAnswer(request.number, why=why)
        with suppress(*PIPE_ERRORS):
            self._send(connection, answer)


class RecorderLink:
    """The end of the page's server. It connects in a thread of its own, again and again."""

    def __init__(self, hub: Hub, address: PrivateAddress, delay: float = START_DELAY) -> None:
        """Show the state of the episodes to all pages of ``hub``.

        Args:
            hub: the hub of the page's server.
            address: address of the process that records.
            delay: time until the first attempt to connect [s].
        """
        # The threads wait when this process ends, and must not keep the hub then.
        self._hub, self._address, self._delay = weakref.ref(hub), address, delay
        self._lock = threading.Condition()
        self._numbers = count(1)
        self._connection: Connection | None = None
        self._pending: dict[int, SimpleQueue[RequestAnswer]] = {}
        self._runs: dict[float, ScriptNote] = {}
        self._sent: SimpleQueue[msgspec.Struct] = SimpleQueue()
        for work in (self._receive, self._send):
            threading.Thread(target=work, name="recorder link", daemon=True).start()

    def note(self, name: str, text: str, began: float, ended: float | None) -> None:
        """Note that a script has begun, or ended. Returns at once."""
        run = ScriptNote(name, text, began, ended)
        with self._lock:
            self._runs[began] = run
            while len(self._runs) > MAX_REPEATED:
                del self._runs[next(iter(self._runs))]
        self._sent.put(run)

    def ask(
        self, request: AnyEpisodeRequest, by: EpisodeGiver, wait: float = 0.0
    ) -> dict[str, Any]:
        """Send ``request`` of ``by`` to the process that records; return the episode.

        Raises InputError if the request is refused, or if no process records within ``wait`` [s].
        """
        answers: SimpleQueue[RequestAnswer] = SimpleQueue()
        with self._lock:
            if not self._lock.wait_for(lambda: self._connection is not None, wait):
                raise InputError(NOT_READY)
            number = next(self._numbers)
            self._pending[number] = answers
        self._sent.put(GivenRequest(number, request, by))
        try:
            answer = answers.get(timeout=ANSWER_SECONDS)
        except Empty:
            raise InputError(SILENT) from None
        finally:
            with self._lock:
                self._pending.pop(number, None)
        if answer.episode is None:
            raise InputError(answer.why)
        return answer.episode

    def _send(self) -> None:
        """Send what waits. What was sent to a process that has ended is answered by ``_lost``."""
        while True:
            message = self._sent.get()
            connection = self._connection
            if connection is not None:
                with suppress(*PIPE_ERRORS):
                    connection.send_bytes(msgspec.json.encode(message))

    def _receive(self) -> None:
        time.sleep(self._delay)
        decoder = msgspec.json.Decoder(RequestAnswer | EpisodesState)
        while True:
            with suppress(*PIPE_ERRORS, ValueError):
                connection = connect(self._address, Greeting(PAGE), GREETING_SECONDS)
                with self._lock:
                    self._connection = connection
                    self._lock.notify_all()
                    for run in self._runs.values():
                        self._sent.put(run)
                while True:
                    message = decoder.decode(connection.recv_bytes(MAX_MESSAGE_BYTES))
                    if isinstance(message, EpisodesState):
                        self._show(message.state)
                    elif (waiting := self._pending.get(message.number)) is not None:
                        waiting.put(message)
            self._lost()
            # A process that ends each connection must not keep this thread busy.
            time.sleep(RECONNECT_SECONDS)

    def _lost(self) -> None:
        """Answer all requests that wait, because the process that records has ended."""
        with self._lock:
            connection, self._connection = self._connection, None
            for number, waiting in self._pending.items():
                waiting.put(RequestAnswer(number, why=ENDED))
        if connection is not None:
            connection.close()
        self._show(None)

    def _show(self, state: dict[str, Any] | None) -> None:
        hub = self._hub()
        if hub is not None:
            hub.shown = {**hub.shown, ENTRY: state}
