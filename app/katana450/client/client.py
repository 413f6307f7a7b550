"""The clients for programs that drive the arm, with asyncio and without."""

from __future__ import annotations

import asyncio
import math
import os
import secrets
import threading
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Coroutine, Iterator
from contextlib import aclosing, asynccontextmanager, contextmanager, suppress
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar
from urllib.parse import quote, urlencode

import msgspec
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as open_websocket
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from katana450.arm.control.commands.act import Id
from katana450.arm.control.commands.checked import encoded_field
from katana450.client.acts import Acts
from katana450.client.files import STOP_TIMEOUT, EpisodeClient, LostError, RefusedError, Site
from katana450.errors import KatanaError
from katana450.server.api import answers, requests
from katana450.server.api.fields import ROOT
from katana450.server.api.program_requests import Program, ProgramOrder, Steer

SOCKET = f"{ROOT}/socket"

ANSWER_TIMEOUT = 5.0
"""[s] Timeout for an answer of the server."""

CLOSE_TIMEOUT = 1.0
"""[s] Timeout for a regular close of the connection, which is then aborted."""

FOLLOW_RATE = 30.0
"""[Hz] Rate of states while a motion is waited for."""

PROGRESS_RATE = 10.0
"""[Hz] Rate of states while a program is waited for."""

PART_CHARACTERS = 150
"""Maximum number of characters of a script per request."""

UNPLANNED_STATUSES = ("refused", "cancelled")
"""Statuses of a program whose planning has failed."""

END_STATUSES = ("done", "stopped", "failed", *UNPLANNED_STATUSES)
"""Statuses of a program that has ended."""

NOT_RUN = "Not run"
"""Begin of the reason for which a program was planned and then not run, as after a STOP."""

A = TypeVar("A", bound=answers.Answer)
T = TypeVar("T")
P = ParamSpec("P")


class AsyncClient(
    Acts[
        Coroutine[Any, Any, answers.State],
        Coroutine[Any, Any, answers.Answer],
        Coroutine[Any, Any, None],
    ]
):
    """One connection, made by ``aconnect``. It sends the heartbeats of the program.

    It has a method for each act beside those below.
    """

    def __init__(self, socket: ClientConnection, welcome: answers.Welcome, site: Site) -> None:
        self._socket = socket
        self._site = site
        self.welcome = welcome
        self._last_id = 0
        self._waiting: dict[Id, asyncio.Future[answers.Answer]] = {}
        self._states: list[asyncio.Queue[answers.State | None]] = []
        self._lost: str | None = None
        self._stops: set[asyncio.Task[str]] = set()
        self._tasks = [asyncio.create_task(work) for work in (self._listen(), self._heartbeat())]

    async def close(self) -> None:
        """Close the connection."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await close_quietly(self._socket)

    async def ask(self, request: requests.Request) -> answers.Answer:
        """Send a request and return its answer; one with ``wait`` is answered after its motion.

        Raises RefusedError with the reason, or LostError if the connection is lost.
        """
        wait = request.wait if isinstance(request, requests.MotionRequest) else None
        timeout = ANSWER_TIMEOUT + (wait or 0.0)
        self._last_id += 1
        request = msgspec.structs.replace(request, id=self._last_id)
        future: asyncio.Future[answers.Answer] = asyncio.get_running_loop().create_future()
        self._waiting[self._last_id] = future
        try:
            await self.send(request)
            async with asyncio.timeout(timeout):
                return await future
        except TimeoutError as error:
            raise LostError(f"The server has not answered for {timeout:g} s.") from error
        finally:
            self._waiting.pop(request.id, None)

    async def send(self, request: requests.Request) -> None:
        """Send ``request`` without waiting for an answer: for streams, Servo and Jog.

        The server refuses a sample that arrives late. Raises LostError if the connection is lost.
        """
        if self._lost is not None:
            raise LostError(self._lost)
        if request.id is None or request.traits.at_once:
            request = msgspec.structs.replace(request, made=time.monotonic())
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT):
                await self._socket.send(
                    msgspec.json.encode(request, enc_hook=encoded_field).decode()
                )
        except ConnectionClosed as error:
            raise LostError(f"The server has closed the connection: {error}.") from error
        except TimeoutError as error:
            self._lose(f"The server has read nothing for {ANSWER_TIMEOUT:g} s.")
            raise LostError(f"The server has read nothing for {ANSWER_TIMEOUT:g} s.") from error

    async def stop(self) -> str:
        """Stop the arm: send STOP on all paths at once, and return its stage.

        It is ``confirmed`` as soon as one path reports a state of the arm that is stopped, and
        ``requested`` if none does although the server has received it. Raises LostError or
        RefusedError if every path fails.
        """
        press, port = secrets.token_urlsafe(16), self.welcome.stop_port
        ports = (None,) if port is None else (None, port)
        paths = [
            self._stop_here(press),
            *(asyncio.to_thread(self._site.stop, press, attempt) for attempt in ports),
        ]
        tasks = [asyncio.create_task(attempt) for attempt in paths]
        # They end by themselves, also those that are not waited for.
        self._stops.update(tasks)
        for task in tasks:
            task.add_done_callback(self._end_stop)
        stage, errors = "", []
        for path in asyncio.as_completed(tasks):
            try:
                stage = await path
            except KatanaError as error:
                errors.append(error)
            if stage == "confirmed":
                return stage
        if not stage:
            raise errors[0]
        return stage

    def _end_stop(self, task: asyncio.Task[str]) -> None:
        self._stops.discard(task)
        if not task.cancelled():
            # Read here, because nothing waits for the slower paths.
            task.exception()

    async def _stop_here(self, press: str) -> str:
        """Send STOP on this connection; return ``confirmed`` once a state shows the stop."""
        await self.ask(requests.Stop(press=press))
        end = time.monotonic() + STOP_TIMEOUT
        while time.monotonic() < end:
            if (await self.query(answers.State)).stop == "confirmed":
                return "confirmed"
            await asyncio.sleep(0.02)
        return "requested"

    async def clear_stop(self, seconds: float = ANSWER_TIMEOUT) -> None:
        """Clear a stop once that is possible: at rest, and 1 s after the newest STOP.

        Without a stop this only acquires the free lease. Raises RefusedError if another client has
        to clear it, or if it cannot be cleared within ``seconds``.
        """
        end = time.monotonic() + seconds
        current = time.monotonic() + 1.0  # After this time a state that showed no stop is not late.
        while True:
            state = await self.query(answers.State)
            if state.stopped is None or state.clearable or time.monotonic() > end:
                try:
                    await self.ask(requests.ClearStop())
                    return
                except RefusedError:
                    # A stop on another path may be newer than the state.
                    newest = await self.query(answers.State)
                    latest = min(end, current) if newest.stopped is None else end
                    if newest.clearable or time.monotonic() > latest:
                        raise
            await asyncio.sleep(0.02)

    async def query(self, kind: type[A]) -> A:
        """Return a current value of the server.

        ``kind``: one of answers.State, Arm, Branches, Loop, Objects, World, Links.
        """
        answer = await self.ask(requests.Query(at=kind.__struct_config__.tag))  # type: ignore[arg-type]
        if not isinstance(answer, kind):
            raise LostError(f"The answer to a query for {kind.__name__} is {answer}.")
        return answer

    async def states(self, hz: float = FOLLOW_RATE) -> AsyncGenerator[answers.State, None]:
        """Yield the state ``hz`` times per second; a slow reader gets only the newest state.

        Raises LostError if the server closes the connection or sends no more states.
        """
        queue: asyncio.Queue[answers.State | None] = asyncio.Queue(1)
        self._states.append(queue)
        try:
            await self.ask(requests.Watch(hz=hz))
            timeout = ANSWER_TIMEOUT + 1.0 / hz
            while (state := await _next_of(queue, timeout)) is not None:
                yield state
            raise LostError(self._lost or "The server has closed the connection.")
        finally:
            self._states.remove(queue)
            if self._lost is None and not self._states:
                # The client may have been closed meanwhile.
                with suppress(LostError):
                    await self.send(requests.Watch(hz=0.0))

    async def send_script(self, text: str, speed: float = 1.0) -> None:
        """Send a script (see docs/programs.md), which the server then plans.

        ``speed``: fraction of the script's own speed. Raises RefusedError and LostError.
        """
        parts = [text[k : k + PART_CHARACTERS] for k in range(0, len(text), PART_CHARACTERS)] or [
            ""
        ]
        for part in parts[:-1]:
            await self.ask(Program(text=part, more=True))
        await self.ask(Program(text=parts[-1], speed=speed))

    async def run(self, script: str | Path, speed: float = 1.0) -> answers.State:
        """Plan and run a script; return the state at its end.

        Args:
            script: its text, such as ``str(program)``, or its file.
            speed: fraction of the script's own speed.

        Raises:
            RefusedError: it cannot be planned, or ends early; with the reason.
            LostError: the connection is lost.
        """
        text = script
        if isinstance(script, Path):
            text = await asyncio.to_thread(script.read_text, encoding="utf-8")
        await self.send_script(str(text), speed)
        # It runs as soon as it is planned.
        await self.ask(Steer(order=ProgramOrder.RUN))
        async with aclosing(self.states(PROGRESS_RATE)) as states:
            async for state in states:
                now = state.program
                if now is None:
                    raise LostError("The server no longer knows the program.")
                if now.status == "done":
                    return state
                if is_over(now):
                    raise RefusedError(now.why)
        raise LostError(self._lost or "The server has closed the connection.")

    async def go(self, request: requests.Request, seconds: float = 60.0) -> answers.State:
        """Request a motion and wait until the arm is at rest; return its state then.

        Its ``why`` is empty if the target was reached.

        Args:
            request: the motion.
            seconds: timeout [s].

        Raises:
            RefusedError: the motion was refused, stopped or taken over by another driver, even if
                the stop was cleared since.
            TimeoutError: the arm was not at rest after ``seconds``.
        """
        done = await self.ask(request)
        ticket = revocations = None
        if isinstance(done, answers.Done):
            ticket = done.ticket
            # A resumed program ends by itself, which also changes the driver.
            revocations = None if request.traits.pacing else done.revocations
        async with asyncio.timeout(seconds):
            async for state in self.states():
                if state.stopped is not None:
                    raise RefusedError(state.stopped)
                if revocations is not None and state.revocations != revocations:
                    raise RefusedError("The arm was stopped or changed its driver on the way.")
                if state.ticket >= (ticket or 0) and not state.moving:
                    return state
        raise LostError("The server has closed the connection.")

    async def fork(
        self,
        t: float,
        recording: str | os.PathLike[str] | None = None,
        wait: float | None = None,
    ) -> answers.State:
        """Let the simulated arm continue from a recorded moment; return its state.

        Posture, speed, tool, objects and water are as they were then, and a motion that was under
        way continues to its goal, unless another command follows.

        Args:
            t: the moment [s]: since the epoch, or with a ``recording`` after its start.
            recording: file that the server opens; None for the last minutes of the server.
            wait: maximum duration of the motion whose end is waited for [s]; None for none.

        Raises:
            RefusedError: the arm is real, stopped or driven by another client, the moment cannot be
                simulated exactly, or the motion that is waited for ends early; with the reason.
            OSError: the file cannot be read.
        """
        request = requests.ContinueFrom(t=t, wait=wait)
        if recording is not None:
            data = await asyncio.to_thread(Path(recording).read_bytes)
            content = await asyncio.to_thread(self._site.fetched, f"{ROOT}/playback", data)
            opened = msgspec.json.decode(content)
            request = requests.ContinueFrom(t=opened["start"] + t, of=opened["name"], wait=wait)
        done = await self.ask(request)
        end = done.end if isinstance(done, answers.Done) else None
        if end is not None and end.how not in ("reached", "limited"):
            raise RefusedError(end.why)
        return await self.query(answers.State)

    async def upload(self, file: Path, unit: str | None = None) -> answers.Mesh:
        """Upload the mesh in ``file``; scene objects refer to it by its key.

        ``unit``: mm, cm, in or m; None to let the server guess it. Raises RefusedError.
        """
        data = await asyncio.to_thread(file.read_bytes)
        query = {"name": file.name} | ({} if unit is None else {"unit": unit})
        path = f"{ROOT}/mesh?{urlencode(query)}"
        return await asyncio.to_thread(self._site.answered, path, data, answers.Mesh)

    async def save_scene(self) -> bytes:
        """Return the current scene as the contents of a .zip file."""
        return await asyncio.to_thread(self._site.fetched, f"{ROOT}/scene")

    async def load_scene(self, data: bytes) -> answers.Scene:
        """Replace the scene by the one in the .zip file contents ``data``."""
        scene = await asyncio.to_thread(self._site.answered, f"{ROOT}/scene", data, answers.Scene)
        await self.ask(requests.Load(scene=scene.key))
        return scene

    @property
    def episodes(self) -> EpisodeClient:
        """Episodes of the server. Each call blocks, so use ``asyncio.to_thread``."""
        return EpisodeClient(self._site)

    async def recording(self, last: float = math.inf) -> bytes:
        """Return the recording of the last seconds as the contents of an MCAP file.

        ``last``: time before the end of the recording [s]; at most ten minutes of motion are kept.
        Raises RefusedError if the server records nothing, or has recorded nothing yet.
        """
        path = f"{ROOT}/recording?{urlencode({'last': last})}"
        return await asyncio.to_thread(self._site.fetched, path)

    async def _heartbeat(self) -> None:
        while True:
            await self.send(requests.Heartbeat())
            await asyncio.sleep(self.welcome.heartbeat)

    async def _listen(self) -> None:
        try:
            async for text in self._socket:
                self._dispatch(answers.decoded(text))
            self._lose("The server has closed the connection.")
        except ConnectionClosed as error:
            self._lose(f"The server has closed the connection: {error}.")
        except msgspec.MsgspecError as error:
            self._lose(f"The server sent an unknown message: {error}.")

    def _dispatch(self, answer: answers.Answer) -> None:
        future = self._waiting.get(answer.id)
        if future is not None and not future.done():
            if isinstance(answer, answers.Refused):
                future.set_exception(RefusedError(answer.why, answer.retry))
            else:
                future.set_result(answer)
        elif isinstance(answer, answers.State):
            self._pass_on(answer)

    def _pass_on(self, state: answers.State | None) -> None:
        """Put the state into all queues, in place of a state that was not read yet."""
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
        raise LostError(f"The server has sent no state for {seconds:.1f} s.") from error


async def close_quietly(socket: ClientConnection) -> None:
    """Close ``socket``, after CLOSE_TIMEOUT at the latest.

    ``close`` alone first sends all waiting bytes, so it never ends if the server reads nothing.
    """
    with suppress(TimeoutError):
        async with asyncio.timeout(CLOSE_TIMEOUT):
            await socket.close()
    socket.transport.abort()


def is_over(program: answers.Progress) -> bool:
    """Return whether ``program`` has ended, or is not going to run."""
    return program.status in END_STATUSES or program.why.startswith(NOT_RUN)


@asynccontextmanager
async def aconnect(
    url: str = "http://127.0.0.1:8080", name: str = "Program", token: str = ""
) -> AsyncIterator[AsyncClient]:
    """Connect to the server at ``url``, for as long as the context lasts.

    Args:
        url: address of the server.
        name: name that other people see.
        token: token of an access link, the part after its ``#``, if the server requires one.

    Raises:
        LostError: there is no server.
        RefusedError: the server does not admit the program.
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
        raise LostError(f"The server at {url} sent an unknown greeting: {welcome}.")
    client = AsyncClient(socket, welcome, Site(url, token, name))
    try:
        yield client
    finally:
        await client.close()


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
    fork = _blocking(AsyncClient.fork)
    upload = _blocking(AsyncClient.upload)
    save_scene = _blocking(AsyncClient.save_scene)
    load_scene = _blocking(AsyncClient.load_scene)
    send_script = _blocking(AsyncClient.send_script)
    run = _blocking(AsyncClient.run)
    recording = _blocking(AsyncClient.recording)

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
