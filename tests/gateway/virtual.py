"""A server in this process, on a clock of its own: its clients are in memory, and nothing waits.

Hub, gate, dispatcher, routes, control loop and session are the real ones. Missing are the processes
and pipes between them, the sockets, viser and the port of STOP, which other tests have. While
nothing is to be done, the clock is set to the next moment at which something is.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self, TypeVar, cast
from urllib.parse import unquote, urlencode, urlsplit

import pytest
from starlette.applications import Starlette
from websockets.exceptions import ConnectionClosed, ConnectionClosedError
from websockets.frames import Close

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor
from katana450.arm.control.session.stopping import SilenceProfile
from katana450.arm.drivers.driver import SimulatedDriver
from katana450.arm.robot.object_meshes import InitialScene
from katana450.arm.runtime.loop import REST_PERIOD, ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.assembly.frontend import NODES
from katana450.assembly.gateway import REFUSALS, RUNNER, control_routes
from katana450.assembly.page_routes import page_routes
from katana450.assembly.robot_session import DescribedRobot
from katana450.cli.serve_options import add_serve_options
from katana450.client import Client
from katana450.client.client import AsyncClient
from katana450.client.files import RefusedError, Site
from katana450.extension import load, provided
from katana450.server.api import answers, requests
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.budget import Budgets
from katana450.server.service.command_gate import guarded
from katana450.server.service.heartbeats import ARRIVAL, LastHeartbeat
from katana450.server.service.hub import TICK, Hub
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.web.access_links import AccessFile
from katana450.server.web.admission import Admission
from katana450.server.web.authenticator import LOOPBACK_NAMES, Address, Authenticator
from katana450.server.web.http_api import Api
from katana450.server.web.security import SecurityMiddleware
from katana450.settings import Settings
from tests.gateway.client import Control, page_name
from tests.gateway.lines import JsonProgram
from tests.gateway.virtual_clock import PERIOD, VirtualClock, VirtualLoop

T = TypeVar("T")

HOST = "127.0.0.1:9"
"""Address of the server, at which nothing listens."""

TRIP = 0.002
"""[s] Time that a call of a program takes, so that time passes for one that only asks."""


class _Pipe:
    """The control loop, in place of the pipe to the arm's process."""

    age = 0.0

    def __init__(
        self,
        described: DescribedRobot,
        loop: VirtualLoop,
        clock: VirtualClock,
        profile: SilenceProfile,
        scene: InitialScene | None,
    ) -> None:
        robot, session, _ = described
        self._loop = loop
        arm = robot.joint_group if robot.arm is None else robot.arm
        self._mailbox = Mailbox(session.check)
        if scene is not None:
            self._mailbox.put(scene.command)
        begin = session.ready if scene is None or scene.joints is None else scene.joints
        driver = SimulatedDriver(arm, begin, 0.0)
        rate = 1.0 / PERIOD
        self._control = ControlLoop(session, driver, self._mailbox, clock, rate, profile=profile)
        self._clock, self.profile = clock, profile
        self.state_publisher = self._control.state_publisher
        self._woken = asyncio.Event()

    @property
    def last_ticket(self) -> int:
        return self._mailbox.last_ticket

    def deliver(self, command: cmd.Command, actor: Actor | None = None) -> int:
        if isinstance(command, cmd.Servo):
            command = command.timed(self._clock.t)
        ticket = self._mailbox.put(command, actor)
        # Also from threads that plan.
        self._loop.call_soon_threadsafe(self._woken.set)
        return ticket

    def heartbeat(self) -> None:
        """Ignore it: the arm's own watch is tested elsewhere."""

    async def run(self, hub: Hub) -> None:
        """Tick as the thread of the loop does."""
        publisher = self.state_publisher
        while True:
            before = publisher.snapshot.state
            self._woken.clear()
            self._control.tick()
            state = publisher.snapshot.state
            if (state.stopped is None) != (before.stopped is None):
                hub.follow_stop()
            moves = state.moving or state.under_way
            with suppress(TimeoutError):
                async with asyncio.timeout(PERIOD if moves else REST_PERIOD):
                    if moves:
                        await asyncio.sleep(1.0)
                    await self._woken.wait()


class Socket:
    """The client's end of a websocket, in place of that of `websockets`."""

    def __init__(self, server: VirtualServer, path: str, headers: dict[str, str]) -> None:
        self._to_server: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._to_client: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self.close_code: int | None = None
        self.close_reason = ""
        self.transport = SimpleNamespace(abort=lambda: None)
        self._closed = asyncio.Event()
        scope = server.scope(path, headers) | {"type": "websocket", "subprotocols": []}
        scope[ARRIVAL] = LastHeartbeat(server.clock.now)
        self._to_server.put_nowait({"type": "websocket.connect"})
        served = server.app(scope, self._to_server.get, cast(Any, self._to_client.put))
        self._task = asyncio.ensure_future(served)
        self._task.add_done_callback(lambda _: self._to_client.put_nowait({"type": "end"}))

    async def send(self, text: str) -> None:
        """Send ``text``. Raises ConnectionClosed."""
        if self.close_code is not None:
            raise self._error()
        self._to_server.put_nowait({"type": "websocket.receive", "text": text})
        await asyncio.sleep(0)

    async def recv(self) -> str:
        """Return the next text. Raises ConnectionClosed."""
        while True:
            if self.close_code is not None:
                raise self._error()
            message = await self._to_client.get()
            if message["type"] == "websocket.send":
                return str(message["text"])
            if message["type"] in ("websocket.close", "end"):
                self._close(message.get("code", 1006), message.get("reason") or "")

    async def __aiter__(self) -> Any:
        with suppress(ConnectionClosed):
            while True:
                yield await self.recv()

    async def wait_closed(self) -> None:
        """Wait until the server closes the websocket; what it sends until then is lost."""
        with suppress(ConnectionClosed):
            while not self._closed.is_set():
                await self.recv()

    async def close(self) -> None:
        """Close the websocket."""
        if self.close_code is None:
            self._to_server.put_nowait({"type": "websocket.disconnect", "code": 1000})
            self._close(1000, "")
            await asyncio.wait([self._task])

    def _close(self, code: int, why: str) -> None:
        self.close_code, self.close_reason = code, why
        self._closed.set()

    def _error(self) -> ConnectionClosed:
        return ConnectionClosedError(Close(self.close_code or 1006, self.close_reason), None)


class VirtualClient(Client):
    """A program in this process."""

    def __init__(self, client: AsyncClient, server: VirtualServer) -> None:
        super().__init__(client, server.loop)
        self._server = server

    def stop(self) -> str:
        """Press STOP, on the only path that there is."""
        stage: str = self._wait(self._client._stop_here(page_name()))
        return stage

    def save_scene(self) -> bytes:
        """See ``AsyncClient.save_scene``."""
        return self._fetched("scene", None)

    def load_scene(self, data: bytes) -> answers.Scene:
        """See ``AsyncClient.load_scene``."""
        scene = answers.decoded(self._fetched("scene", data).decode())
        assert isinstance(scene, answers.Scene)
        self.ask(requests.Load(scene=scene.key))
        return scene

    def upload(self, file: Path, unit: str | None = None) -> answers.Mesh:
        """See ``AsyncClient.upload``."""
        query = {"name": file.name} | ({} if unit is None else {"unit": unit})
        mesh = answers.decoded(
            self._fetched(f"mesh?{urlencode(query)}", file.read_bytes()).decode()
        )
        assert isinstance(mesh, answers.Mesh)
        return mesh

    def _fetched(self, what: str, data: bytes | None) -> bytes:
        token = {"Authorization": f"Bearer {self._client._site.token}"}
        status, _, body = self._server.ask(f"/api/v1/{what}", data=data, **token)
        if status != 200:
            raise RefusedError(body.decode())
        return body

    def _wait(self, work: Coroutine[Any, Any, Any]) -> Any:
        return self._server.run(_with_trip(work))


async def _with_trip(work: Coroutine[Any, Any, T]) -> T:
    result = await work
    await asyncio.sleep(TRIP)
    return result


class Rows(JsonProgram):
    """A simple program on a websocket."""

    def __init__(self, server: VirtualServer, name: str, token: str = "") -> None:
        self._server = server
        self._socket = server.run(server.program_socket(name, token))

    def raw(self, data: bytes) -> None:
        self._server.run(self._socket.send(data.decode()))

    def hear(self) -> dict[str, Any]:
        heard: dict[str, Any] = json.loads(self._server.run(_with_trip(self._socket.recv())))
        return heard

    def sleep(self, seconds: float) -> None:
        self._server.sleep(seconds)

    def ends(self) -> int | None:
        """Wait until the server closes the connection, and return its code."""
        self._server.run(self._socket.wait_closed())
        return self._socket.close_code

    def close(self) -> None:
        """Leave."""
        self._server.run(self._socket.close())


@cache
def _options(words: tuple[str, ...]) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_serve_options(parser)
    return parser.parse_args(["--no-record", *words])


class VirtualServer:
    """A server on a virtual clock, for the clients that its methods make.

    Attributes:
        clock: its clock.
        hub: its hub.
        url: its origin.
    """

    url = f"http://{HOST}"

    def __init__(
        self,
        described: DescribedRobot,
        *words: str,
        access: AccessFile | None = None,
        profile: SilenceProfile = SilenceProfile.REAL_ARM,
    ) -> None:
        """Start a server with the robot ``described`` and the options ``words`` of `serve`."""
        self.clock = VirtualClock()
        self.loop = VirtualLoop(self.clock)
        options, settings, now = _options(words), Settings(), self.clock.now
        robot, session, _ = described
        self.hub = hub = Hub(now, settings.silence)
        hub.requires_link = access is not None
        address = Address(LOOPBACK_NAMES, any_address=False, secure=False)
        self.authenticator = Authenticator(access, 9, address)
        budgets = Budgets(now)
        hub.use_runner(load(RUNNER)(hub, options))
        for handler in provided("handler"):
            hub.add_handler(handler(hub, options))
        api = Api(hub, self.authenticator, budgets, options, list(provided("routes")))
        ready = asyncio.Event()
        ready.set()
        web = cast(Any, SimpleNamespace(authenticator=self.authenticator, ready=ready))
        proxy = Proxy(hub, self.authenticator, cast(Any, None), 0, "")
        routes = [
            *page_routes(self.authenticator, hub.stop_path, hub.recorder),
            *control_routes(hub, budgets, web, proxy),
            *api.routes(),
        ]
        app = Starlette(routes=routes, exception_handlers=cast(Any, REFUSALS))
        acceptor = cast(Any, SimpleNamespace(kept=lambda _client: nullcontext()))
        admission = Admission(app, hub, self.authenticator, acceptor)
        self.app = SecurityMiddleware(admission, address)
        scenes = (make(options, lambda: session) for make in provided("initial_scene"))
        scene = next((part for part in scenes if part is not None), None)
        hub.meshes.put(() if scene is None else scene.meshes, ())
        self.arm = _Pipe(described, self.loop, self.clock, profile, scene)
        pipe = cast(Any, self.arm)
        worker = None
        if robot.arm is not None:
            worker = PlanningWorker(session, self.arm.state_publisher, pipe)
            worker.notify = lambda why: self._soon(hub.announce, why)
            worker.redirected = guarded(hub.runner.redirected)
        values = load(NODES)(robot, session.environment)
        hub.gate.arm = ArmHandle(robot, session, pipe, worker, values)
        self._tasks = [self.loop.create_task(part) for part in (self.arm.run(hub), self._watch())]

    def _soon(self, act: Any, *arguments: Any) -> None:
        self.loop.call_soon_threadsafe(act, *arguments)

    async def _watch(self) -> None:
        while True:
            self.hub.tick()
            await asyncio.sleep(TICK)

    def __enter__(self) -> Self:
        """Let the clock of this thread be that of the server."""
        real, thread = time.sleep, threading.current_thread()

        def sleep(seconds: float) -> None:
            # A thread of the server, in whose place this one works, waits in fact.
            if threading.current_thread() is thread and not self.loop.is_running():
                self.sleep(seconds)
            else:
                real(seconds)

        self._patches = pytest.MonkeyPatch()
        self._patches.setattr(time, "monotonic", self.clock.now)
        self._patches.setattr(time, "perf_counter", self.clock.now)
        self._patches.setattr(time, "sleep", sleep)
        return self

    def __exit__(self, *_error: object) -> None:
        """End all that runs."""
        tasks = asyncio.all_tasks(self.loop)
        for task in tasks:
            task.cancel()
        self.loop.run_until_complete(asyncio.wait(tasks))
        self._patches.undo()
        self.loop.close()

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Return the result of ``work``, for which the time passes."""
        for task in self._tasks:
            if task.done():
                task.result()
        return self.loop.run_until_complete(work)

    def sleep(self, seconds: float) -> None:
        """Let ``seconds`` pass."""
        self.run(asyncio.sleep(seconds))

    # Clients

    def scope(self, path: str, headers: dict[str, str]) -> dict[str, Any]:
        """Return what the web server tells the application about a request."""
        parts = urlsplit(path)
        named = {name.replace("_", "-").lower(): text for name, text in headers.items()}
        named.setdefault("host", HOST)
        return {
            "type": "http",
            "path": unquote(parts.path),
            "raw_path": parts.path.encode(),
            "query_string": parts.query.encode(),
            "headers": [(name.encode(), text.encode()) for name, text in named.items()],
            "client": ("127.0.0.1", 5000),
            "server": ("127.0.0.1", 9),
            "scheme": "http",
            "root_path": "",
            "http_version": "1.1",
        }

    async def request(
        self,
        path: str,
        data: bytes | None = None,
        leaves: asyncio.Event | None = None,
        meanwhile: Callable[[], object] = lambda: None,
        **headers: Any,
    ) -> tuple[int, dict[str, str], bytes]:
        """Return status, headers and body of a response, as ``client.ask`` does.

        ``leaves``: set when the client closes the connection. ``meanwhile``: called before its body
        arrives.
        """
        scope = self.scope(path, headers) | {"method": "GET" if data is None else "POST"}
        messages = [{"type": "http.request", "body": data or b"", "more_body": False}]
        status, answer_headers, body = 0, {}, b""

        async def receive() -> dict[str, Any]:
            if messages:
                meanwhile()
                return messages.pop()
            await (leaves or asyncio.Event()).wait()
            return {"type": "http.disconnect"}

        async def send(message: dict[str, Any]) -> None:
            nonlocal status, answer_headers, body
            if message["type"] == "http.response.start":
                status = message["status"]
                answer_headers = {name.decode(): text.decode() for name, text in message["headers"]}
            else:
                body += message.get("body", b"")

        await self.app(scope, receive, cast(Any, send))
        return status, answer_headers, body

    def ask(
        self, path: str, *, data: bytes | None = None, **headers: Any
    ) -> tuple[int, dict[str, str], bytes]:
        """Return status, headers and body of a response; ``headers`` have _ for -."""
        return self.run(_with_trip(self.request(path, data, **headers)))

    async def posted(self, program: str, **request: Any) -> tuple[int, Any]:
        """Return status and answer of a single request over HTTP."""
        data = json.dumps(request).encode()
        status, _, body = await self.request("/api/v1/do", data, X_Program=program)
        return status, json.loads(body)

    def post(self, program: str = "a-test-that-posts", **request: Any) -> tuple[int, Any]:
        """Return status and answer of a single request over HTTP."""
        return self.run(_with_trip(self.posted(program, **request)))

    def state(self) -> answers.State:
        """Return the state, as nobody in particular asks for it."""
        state = answers.decoded(self.ask("/api/v1/state")[2].decode())
        assert isinstance(state, answers.State)
        return state

    async def program_socket(self, name: str, token: str = "") -> Socket:
        """Return the websocket of a program, whose welcome is read."""
        headers = {"authorization": f"Bearer {token}"} if token else {}
        socket = Socket(self, f"/api/v1/socket?name={name}", headers)
        assert json.loads(await socket.recv())["is"] == "welcome"
        return socket

    @contextmanager
    def connect(self, name: str = "Program", token: str = "") -> Iterator[Client]:
        """Connect a program, as ``client.connect`` does."""

        async def begun() -> AsyncClient:
            headers = {"authorization": f"Bearer {token}"} if token else {}
            socket = Socket(self, f"/api/v1/socket?name={name}", headers)
            try:
                welcome = answers.decoded(await socket.recv())
            except ConnectionClosed as error:
                raise RefusedError(socket.close_reason) from error
            assert isinstance(welcome, answers.Welcome)
            return AsyncClient(cast(Any, socket), welcome, Site(self.url, token, name))

        client = self.run(begun())
        try:
            yield VirtualClient(client, self)
        finally:
            self.run(client.close())

    @contextmanager
    def speaking(self, name: str = "Lines", token: str = "") -> Iterator[Rows]:
        """Connect a simple program."""
        rows = Rows(self, name, token)
        try:
            yield rows
        finally:
            rows.close()

    async def enter(self, token: str = "") -> str:
        """Return the cookie of a new session."""
        body = json.dumps({"token": token}).encode()
        status, headers, answer = await self.request("/enter", body, Origin=self.url)
        assert status == 204, answer
        return headers["set-cookie"].partition(";")[0]

    async def control(self, cookie: str | None = None, page: str | None = None) -> Control:
        """Open the control socket of a page."""
        cookie = await self.enter() if cookie is None else cookie
        headers = {"cookie": cookie, "origin": self.url}
        socket = Socket(self, f"/control?page={page or page_name()}", headers)
        return Control(cast(Any, socket))
