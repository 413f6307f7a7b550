"""The client for programs without asyncio that drive the arm. Each call waits for its result."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import AsyncGenerator, Coroutine, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy.typing as npt

from katana450.client.asynchronous import ANSWER_TIMEOUT, FOLLOW_RATE, AsyncClient, aconnect
from katana450.client.episodes import EpisodeClient
from katana450.server.api import answers, requests

T = TypeVar("T")
A = TypeVar("A", bound=answers.Answer)


class Client:
    """One connection, made by ``connect``. A separate thread sends its heartbeats."""

    def __init__(self, client: AsyncClient, loop: asyncio.AbstractEventLoop) -> None:
        self._client = client
        self._loop = loop

    @property
    def welcome(self) -> answers.Welcome:
        """Greeting of the server, which contains the identity of this client."""
        return self._client.welcome

    def ask(self, request: requests.Request) -> answers.Answer:
        """See ``AsyncClient.ask``."""
        return self._wait(self._client.ask(request))

    def send(self, request: requests.Request) -> None:
        """See ``AsyncClient.send``."""
        self._wait(self._client.send(request))

    def stop(self) -> str:
        """See ``AsyncClient.stop``."""
        return self._wait(self._client.stop())

    def clear_stop(self, seconds: float = ANSWER_TIMEOUT) -> None:
        """See ``AsyncClient.clear_stop``."""
        self._wait(self._client.clear_stop(seconds))

    def query(self, kind: type[A]) -> A:
        """See ``AsyncClient.query``."""
        return self._wait(self._client.query(kind))

    def go(self, request: requests.Request, seconds: float = 60.0) -> answers.State:
        """See ``AsyncClient.go``."""
        return self._wait(self._client.go(request, seconds))

    def joints(self, q: npt.ArrayLike) -> answers.State:
        """See ``AsyncClient.joints``."""
        return self._wait(self._client.joints(q))

    def nudge(self, axis: int, by: float) -> answers.State:
        """See ``AsyncClient.nudge``."""
        return self._wait(self._client.nudge(axis, by))

    def upload(self, file: Path, unit: str | None = None) -> answers.Mesh:
        """See ``AsyncClient.upload``."""
        return self._wait(self._client.upload(file, unit))

    def save_scene(self) -> bytes:
        """See ``AsyncClient.save_scene``."""
        return self._wait(self._client.save_scene())

    def load_scene(self, data: bytes) -> answers.Scene:
        """See ``AsyncClient.load_scene``."""
        return self._wait(self._client.load_scene(data))

    def send_script(self, text: str, speed: float = 1.0) -> None:
        """See ``AsyncClient.send_script``."""
        self._wait(self._client.send_script(text, speed))

    def run(self, script: str | Path, speed: float = 1.0) -> answers.State:
        """See ``AsyncClient.run``."""
        return self._wait(self._client.run(script, speed))

    @property
    def episodes(self) -> EpisodeClient:
        """Episodes of the server: record, judge and list them."""
        return self._client.episodes

    def recording(self, last: float = math.inf) -> bytes:
        """See ``AsyncClient.recording``."""
        return self._wait(self._client.recording(last))

    def people(self) -> tuple[answers.ConnectedPerson, ...]:
        """See ``AsyncClient.people``."""
        return self._wait(self._client.people())

    def kick(self, person: int, seconds: float = 60.0, *, revoke: bool = False) -> None:
        """See ``AsyncClient.kick``."""
        self._wait(self._client.kick(person, seconds, revoke=revoke))

    def states(self, hz: float = FOLLOW_RATE) -> Iterator[answers.State]:
        """See ``AsyncClient.states``."""
        states = self._client.states(hz)
        try:
            while True:
                yield self._wait(_next(states))
        finally:
            self._wait(states.aclose())

    def _wait(self, work: Coroutine[Any, Any, T]) -> T:
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return future.result()
        except BaseException:
            # After Ctrl-C nothing waits for the result.
            future.cancel()
            raise


async def _next(states: AsyncGenerator[answers.State, None]) -> answers.State:
    return await anext(states)


@contextmanager
def connect(
    url: str = "http://127.0.0.1:8080", name: str = "Program", token: str = ""
) -> Iterator[Client]:
    """Connect to the server at ``url``, for as long as the context lasts; see ``aconnect``."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name="katana450 client", daemon=True)
    thread.start()
    context = aconnect(url, name, token)

    def wait(work: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(work, loop).result()

    try:
        client = Client(wait(context.__aenter__()), loop)
        try:
            yield client
        finally:
            wait(context.__aexit__(None, None, None))
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
