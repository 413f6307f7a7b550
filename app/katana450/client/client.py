"""The client for programs without asyncio that drive the arm. Each call waits for its result."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable, Coroutine, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from katana450.client.acts import Acts
from katana450.client.asynchronous import FOLLOW_RATE, AsyncClient, aconnect
from katana450.client.files import EpisodeClient
from katana450.server.api import answers

T = TypeVar("T")
P = ParamSpec("P")
A = TypeVar("A", bound=answers.Answer)


def _blocking(
    method: Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, T]],
) -> Callable[Concatenate[Client, P], T]:
    """Return the method of ``Client`` that waits for the result of ``method``."""

    @wraps(method)
    def blocking(client: Client, /, *args: P.args, **fields: P.kwargs) -> T:
        return client._wait(method(client._client, *args, **fields))

    return blocking


class Client(Acts[answers.State, answers.Answer, None]):
    """One connection, made by ``connect``. A separate thread sends its heartbeats.

    Its methods are those of ``AsyncClient``. Each waits for its result.
    """

    def __init__(self, client: AsyncClient, loop: asyncio.AbstractEventLoop) -> None:
        self._client = client
        self._loop = loop

    @property
    def welcome(self) -> answers.Welcome:
        """Greeting of the server, which contains the identity of this client."""
        return self._client.welcome

    @property
    def episodes(self) -> EpisodeClient:
        """Episodes of the server: record, judge and list them."""
        return self._client.episodes

    ask = _blocking(AsyncClient.ask)
    send = _blocking(AsyncClient.send)
    stop = _blocking(AsyncClient.stop)
    clear_stop = _blocking(AsyncClient.clear_stop)
    go = _blocking(AsyncClient.go)
    upload = _blocking(AsyncClient.upload)
    save_scene = _blocking(AsyncClient.save_scene)
    load_scene = _blocking(AsyncClient.load_scene)
    send_script = _blocking(AsyncClient.send_script)
    run = _blocking(AsyncClient.run)
    recording = _blocking(AsyncClient.recording)
    people = _blocking(AsyncClient.people)

    def query(self, kind: type[A]) -> A:
        """See ``AsyncClient.query``."""
        return self._wait(self._client.query(kind))

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
