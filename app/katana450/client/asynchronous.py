"""A program's hand on the arm, for asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote

import msgspec
import numpy as np
import numpy.typing as npt
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as open_websocket
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from katana450.client.files import LostError, RefusedError, Site
from katana450.server.api import answers, requests
from katana450.server.api.fields import ROOT, Id

SOCKET = f"{ROOT}/socket"

ANSWER_TIMEOUT = 5.0
"""[s] An answer that takes longer does not come."""

CLOSE_TIMEOUT = 1.0
"""[s] For hanging up properly; then the connection is cut off."""

FOLLOW_RATE = 30.0
"""[Hz] States while a motion is waited for."""

A = TypeVar("A", bound=answers.Answer)


class AsyncClient:
    """One connection; made by ``aconnect``, which also gives heartbeats."""

    def __init__(self, socket: ClientConnection, welcome: answers.Welcome, site: Site) -> None:
        self._socket = socket
        self._site = site
        self.welcome = welcome
        self._asked = 0
        self._waiting: dict[Id, asyncio.Future[answers.Answer]] = {}
        self._states: list[asyncio.Queue[answers.State | None]] = []
        self._lost: str | None = None
        self._tasks = [asyncio.create_task(each) for each in (self._listen(), self._heartbeat())]

    async def close(self) -> None:
        """Hang up."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await close_quietly(self._socket)

    async def ask(self, request: requests.Request) -> answers.Answer:
        """The answer to any request. Raises RefusedError with the reason, LostError."""
        self._asked += 1
        request = msgspec.structs.replace(request, id=self._asked)
        future: asyncio.Future[answers.Answer] = asyncio.get_running_loop().create_future()
        self._waiting[self._asked] = future
        try:
            await self._say(request)
            async with asyncio.timeout(ANSWER_TIMEOUT):
                return await future
        except TimeoutError as error:
            raise LostError(f"No answer has come in {ANSWER_TIMEOUT:g} s.") from error
        finally:
            self._waiting.pop(request.id, None)

    async def tell(self, request: requests.Request) -> None:
        """Say ``request`` and wait for no answer: for streams, Servo and Jog."""
        await self._say(request)

    async def query(self, kind: type[A]) -> A:
        """One of answers.State, Arm, EventLog, Branches, Loop, Objects, World, Links."""
        answer = await self.ask(requests.Query(at=kind.__struct_config__.tag))  # type: ignore[arg-type]
        if not isinstance(answer, kind):
            raise LostError(f"{kind.__name__} was asked for, and {answer} came.")
        return answer

    async def states(self, hz: float = FOLLOW_RATE) -> AsyncGenerator[answers.State, None]:
        """The state, so many times a second; the newest, when it is asked for more slowly.

        Raises LostError when the server has hung up or sends no more.
        """
        queue: asyncio.Queue[answers.State | None] = asyncio.Queue(1)
        self._states.append(queue)
        try:
            await self.ask(requests.Watch(hz=hz))
            patience = ANSWER_TIMEOUT + 1.0 / hz
            while (state := await _next_of(queue, patience)) is not None:
                yield state
            raise LostError(self._lost or "The server has hung up.")
        finally:
            self._states.remove(queue)
            if self._lost is None and not self._states:
                # A client that is closed meanwhile has nothing left to say.
                with suppress(LostError):
                    await self.tell(requests.Watch(hz=0.0))

    async def go(self, request: requests.Request, seconds: float = 60.0) -> answers.State:
        """Ask for a motion and wait until the arm is at rest; return its state then.

        Its ``why`` is empty if the target was reached. Raises RefusedError if the motion was
        refused, stopped or taken over, even where the stop is cleared already; TimeoutError after
        ``seconds``.
        """
        done = await self.ask(request)
        ticket = revocations = None
        if isinstance(done, answers.Done):
            ticket = done.ticket
            # A program that is resumed ends by itself, which changes the driver too.
            revocations = None if request.traits.for_program else done.revocations
        async with asyncio.timeout(seconds):
            async for state in self.states():
                if state.stopped is not None:
                    raise RefusedError(state.stopped)
                if revocations is not None and state.revocations != revocations:
                    raise RefusedError("The arm was stopped or changed hands on the way.")
                if state.ticket >= (ticket or 0) and not state.moving:
                    return state
        raise LostError("The server has hung up.")

    async def joints(self, q: npt.ArrayLike) -> answers.State:
        """Drive all joints to ``q`` (n,) [rad]; see ``go``."""
        return await self.go(requests.Joints(q=np.asarray(q, dtype=float).tolist()))

    async def nudge(self, axis: int, by: float) -> answers.State:
        """Drive the joint ``axis``, from 1, on by the angle ``by`` [rad]; see ``go``.

        ``why`` of the state says so where the joint's range limits it.
        """
        return await self.go(requests.Nudge(axis=axis, by=by))

    async def upload(self, file: Path, unit: str | None = None) -> answers.Mesh:
        """Bring the mesh in ``file`` to the server, to be placed by its key.

        unit: mm, cm, in or m; None to have it guessed. Raises RefusedError with what is wrong.
        """
        data = await asyncio.to_thread(file.read_bytes)
        return await asyncio.to_thread(self._site.mesh, data, file.name, unit)

    async def save_scene(self) -> bytes:
        """What stands around, as a .zip."""
        return await asyncio.to_thread(self._site.saved)

    async def load_scene(self, data: bytes) -> answers.Scene:
        """Have what stands around in the .zip ``data``, in place of all there is."""
        scene = await asyncio.to_thread(self._site.scene, data)
        await self.ask(requests.Load(scene=scene.key))
        return scene

    async def _say(self, request: requests.Request) -> None:
        if self._lost is not None:
            raise LostError(self._lost)
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT):
                await self._socket.send(msgspec.json.encode(request, enc_hook=_plain).decode())
        except ConnectionClosed as error:
            raise LostError(f"The server has hung up: {error}.") from error
        except TimeoutError as error:
            self._lose(f"The server has read nothing for {ANSWER_TIMEOUT:g} s.")
            raise LostError(f"The server has read nothing for {ANSWER_TIMEOUT:g} s.") from error

    async def _heartbeat(self) -> None:
        while True:
            await self._say(requests.Heartbeat())
            await asyncio.sleep(self.welcome.heartbeat)

    async def _listen(self) -> None:
        try:
            async for text in self._socket:
                self._take(answers.decoded(text))
            self._lose("The server has hung up.")
        except ConnectionClosed as error:
            self._lose(f"The server has hung up: {error}.")
        except msgspec.MsgspecError as error:
            self._lose(f"The server speaks another language: {error}.")

    def _take(self, answer: answers.AnyAnswer) -> None:
        future = self._waiting.get(answer.id)
        if future is not None and not future.done():
            if isinstance(answer, answers.Refused):
                future.set_exception(RefusedError(answer.why))
            else:
                future.set_result(answer)
        elif isinstance(answer, answers.State):
            self._pass_on(answer)

    def _pass_on(self, state: answers.State | None) -> None:
        """To all who watch; what one has not read yet gives way to what is newer."""
        for queue in self._states:
            if queue.full():
                queue.get_nowait()
            queue.put_nowait(state)

    def _lose(self, why: str) -> None:
        self._lost = why
        self._pass_on(None)
        for future in self._waiting.values():
            if not future.done():
                future.set_exception(LostError(why))


async def _next_of(
    queue: asyncio.Queue[answers.State | None], seconds: float
) -> answers.State | None:
    try:
        async with asyncio.timeout(seconds):
            return await queue.get()
    except TimeoutError as error:
        raise LostError(f"No state has come for {seconds:.1f} s.") from error


async def close_quietly(socket: ClientConnection) -> None:
    """Close ``socket``, at the latest after GOODBYE.

    ``close`` alone first sends all that is left: it never ends if the server reads nothing.
    """
    with suppress(TimeoutError):
        async with asyncio.timeout(CLOSE_TIMEOUT):
            await socket.close()
    socket.transport.abort()


def _plain(value: Any) -> Any:
    """Numbers and arrays of numpy's, as JSON has them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is nothing that can be sent: {value!r}")


@asynccontextmanager
async def aconnect(
    url: str = "http://127.0.0.1:8080", name: str = "Program", token: str = ""
) -> AsyncIterator[AsyncClient]:
    """A connection to the server at ``url``, for as long as the context lasts.

    name: how others see it. token: of an access link, where the server asks for one; what stands
    behind the ``#`` of the link. Raises LostError when there is no server, RefusedError when it
    does not let us in.
    """
    address = url.rstrip("/").replace("http", "ws", 1) + f"{SOCKET}?name={quote(name)}"
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        socket = await open_websocket(
            address, additional_headers=headers, compression=None, close_timeout=CLOSE_TIMEOUT
        )
    except (OSError, InvalidHandshake) as error:
        raise LostError(f"There is no katana450 server at {url}: {error}.") from error
    try:
        async with asyncio.timeout(ANSWER_TIMEOUT):
            welcome = answers.decoded(await socket.recv())
    except ConnectionClosed as error:
        why = error.rcvd.reason if error.rcvd is not None else str(error)
        raise RefusedError(why) from error
    except (TimeoutError, msgspec.MsgspecError) as error:
        await close_quietly(socket)
        raise LostError(f"There is no katana450 server at {url}: {error}.") from error
    if not isinstance(welcome, answers.Welcome):
        await close_quietly(socket)
        raise LostError(f"The server at {url} speaks another language: {welcome}.")
    client = AsyncClient(socket, welcome, Site(url, token))
    try:
        yield client
    finally:
        await client.close()
