"""Test the acceptor of connections, and the web server before and while the application starts."""

from __future__ import annotations

import asyncio
import errno
import json
import logging
import socket
import sys
import time
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import ExitStack, asynccontextmanager, closing
from itertools import pairwise
from typing import Any, cast

import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse

from katana450.arm.control.lease import Role
from katana450.assembly.gateway import control_routes
from katana450.assembly.web_server import WebServer
from katana450.server.service.budget import Budgets
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.limits import ConnectionLimit
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.viser_bridge.viser_page import PROGRAM
from katana450.server.web import acceptor as acceptors
from katana450.server.web.acceptor import Acceptor, _Connection
from katana450.server.web.access_links import AccessFile
from katana450.server.web.admission import LIMIT_CLOSE_CODE, SOCKETS, SOCKETS_EACH
from katana450.server.web.channel import CLOSE_FRAME_TIMEOUT, GoneError
from katana450.server.web.listen import WANTED_DESCRIPTORS, listen
from katana450.server.web.program_socket import ProgramChannel
from katana450.settings import Settings
from tests.commands import completed
from tests.gateway.client import HOUR, Control, ask, enter, page_name, websocket
from tests.gateway.virtual import VirtualServer

WAITING = 4


@asynccontextmanager
async def _accepting() -> AsyncIterator[tuple[Acceptor, tuple[str, int]]]:
    with listen("0.0.0.0", 0) as listening:
        acceptor = Acceptor(listening, WAITING).start(asyncio.Protocol)
        try:
            yield acceptor, ("127.0.0.1", listening.getsockname()[1])
        finally:
            acceptor.close()
            await acceptor.wait_closed()


async def _connected(
    server: tuple[str, int], address: str = "127.0.0.1", sent: bytes = b""
) -> socket.socket:
    """Connect from ``address``, send ``sent``, and give the server time to accept."""
    connection = socket.create_connection(server, timeout=2.0, source_address=(address, 0))
    connection.sendall(sent)
    connection.setblocking(False)
    await asyncio.sleep(0.02)
    return connection


def _is_open(connection: socket.socket) -> bool:
    try:
        return connection.recv(1) != b""
    except BlockingIOError:
        return True
    except ConnectionError:
        return False


async def test_oldest_connection_of_the_most_frequent_address_is_closed() -> None:
    async with _accepting() as (_, server):
        lonely = await _connected(server, "127.0.0.2")
        crowd = [await _connected(server) for _ in range(3 * WAITING)]
        await asyncio.sleep(0.1)
        open_ones = [_is_open(connection) for connection in crowd]
        assert open_ones == [False] * (len(crowd) - WAITING + 1) + [True] * (WAITING - 1)
        assert _is_open(lonely)
        for connection in (lonely, *crowd):
            connection.close()


async def test_small_messages_do_not_wait_for_acknowledgements() -> None:
    opened: list[asyncio.Transport] = []

    class Opened(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            assert isinstance(transport, asyncio.Transport)
            opened.append(transport)

    with listen("127.0.0.1", 0) as listening:
        acceptor = Acceptor(listening, WAITING).start(Opened)
        client = await _connected(listening.getsockname())
        (transport,) = opened
        sock = transport.get_extra_info("socket")
        assert sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) == 1
        client.close()
        acceptor.close()
        await acceptor.wait_closed()


async def test_closed_connections_make_room_for_others() -> None:
    async with _accepting() as (_, server):
        early = [await _connected(server) for _ in range(WAITING // 2 + 1)]
        for _ in range(3 * WAITING):
            (await _connected(server)).close()
            await asyncio.sleep(0.01)
        assert all(_is_open(connection) for connection in early)
        for connection in early:
            connection.close()


async def test_kept_connection_is_not_closed_for_others() -> None:
    async with _accepting() as (acceptor, server):
        driver = await _connected(server)
        host, port = driver.getsockname()
        with acceptor.kept((host, port)):
            crowd = [await _connected(server) for _ in range(3 * WAITING)]
            assert _is_open(driver)
        for connection in (driver, *crowd):
            connection.close()


def test_accept_failures_are_logged_once_and_do_not_block_the_loop(
    caplog: pytest.LogCaptureFixture,
) -> None:
    attempts = []

    async def fail(_listening: socket.socket) -> tuple[socket.socket, tuple[str, int]]:
        attempts.append(1)
        raise OSError(errno.EMFILE, "Too many open files")

    async def act(monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(asyncio.get_running_loop(), "sock_accept", fail)
        monkeypatch.setattr(acceptors, "BACK_OFF", 0.02)
        async with _accepting(), asyncio.timeout(20.0):
            while len(attempts) < 3:
                await asyncio.sleep(0.01)

    with caplog.at_level(logging.WARNING), pytest.MonkeyPatch.context() as monkeypatch:
        asyncio.run(act(monkeypatch))
    assert len(attempts) < 20
    assert [record.getMessage() for record in caplog.records] == [
        "A connection could not be accepted: Too many open files."
    ]


@pytest.mark.parametrize("addresses", [["127.0.0.1"], [f"127.0.1.{n}" for n in range(1, 30)]])
async def test_connections_beyond_the_rate_are_opened_once_they_send(
    addresses: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, total = (3.0, 1e3) if len(addresses) == 1 else (1e3, 3.0)
    for name, value in {
        "PREFIX_BURST": one,
        "PREFIX_RATE": 0.0,
        "BURST": total,
        "RATE": 0.0,
    }.items():
        monkeypatch.setattr(acceptors, name, value)
    async with _accepting() as (acceptor, server):
        silent = [await _connected(server, addresses[n % len(addresses)]) for n in range(6)]
        speaking = await _connected(server, addresses[-1], b"x")
        await asyncio.sleep(0.1)
        assert [_is_open(connection) for connection in silent] == [True] * 3 + [False] * 3
        assert _is_open(speaking)
        assert not acceptor._surplus
        # A prefix of its own has places of its own.
        other = await _connected(server, "127.0.2.1")
        await asyncio.sleep(0.1)
        assert _is_open(other) == (len(addresses) == 1)
        for connection in (speaking, other, *silent):
            connection.close()


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("10.0.0.1", "10.0.0.2", False),
        ("2001:db8::1", "2001:db8::ffff:1", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("::ffff:10.0.0.1", "::ffff:10.0.0.2", False),
        ("::ffff:10.0.0.1", "10.0.0.1", True),
        ("fe80::1%eth0", "fe80::2%eth0", True),
    ],
)
def test_ipv6_networks_count_as_one_prefix(one: str, other: str, *, same: bool) -> None:
    with socket.socket() as sock:
        first, second = (_Connection(sock, (host, 1), 0.0).prefix for host in (one, other))
    assert (first == second) == same


@pytest.mark.parametrize(("soft", "hard"), [(256, 2048), (256, 512)])
def test_descriptor_limit_is_raised_as_far_as_the_system_allows(soft: int, hard: int) -> None:
    program = (
        "import resource\n"
        "from katana450.server.web.listen import raise_descriptor_limit\n"
        f"resource.setrlimit(resource.RLIMIT_NOFILE, ({soft}, {hard}))\n"
        "raise_descriptor_limit()\n"
        "print(resource.getrlimit(resource.RLIMIT_NOFILE)[0])\n"
    )
    done = completed([sys.executable, "-c", program])
    assert int(done.stdout) == min(hard, WANTED_DESCRIPTORS)
    assert ("Raise the limit to" in done.stderr) == (hard < 1024)


ASKED = 200


class Torrent:
    """A connection on which all requests have already arrived."""

    def __init__(self) -> None:
        self.left = ASKED
        self.arrival = LastHeartbeat()

    async def receive(self) -> str:
        if not self.left:
            await asyncio.Event().wait()
        self.left -= 1
        return '{"do": "heartbeat"}'

    async def send(self, _text: str) -> None:
        return

    async def close(self, _code: int, _why: str, /) -> None:
        raise GoneError


class Deaf(Torrent):
    """A connection that accepts no data, not even a close frame."""

    async def send(self, _text: str) -> None:
        await asyncio.Event().wait()

    async def close(self, _code: int, _why: str, /) -> None:
        await asyncio.Event().wait()


def test_flooding_client_does_not_delay_others() -> None:
    async def ask() -> list[int]:
        hub, torrent = Hub(time.monotonic), Torrent()
        program = ProgramChannel(hub, torrent, Budgets(hub.clock).of("a"))
        window = hub.join(Identity("session", "Torrent", Role.OPERATOR), "a-page", program.notify)
        asking = asyncio.create_task(program.run(window))
        remaining = [torrent.left]
        while torrent.left:
            await asyncio.sleep(0)
            remaining.append(torrent.left)
        asking.cancel()
        return remaining

    remaining = asyncio.run(ask())
    assert remaining[-1] == 0
    assert max(before - after for before, after in pairwise(remaining)) == 1


async def test_unresponsive_flooder_is_disconnected() -> None:
    hub, deaf = Hub(time.monotonic), Deaf()
    deaf.left = 10**9
    program = ProgramChannel(hub, deaf, Budgets(hub.clock).of("a"))
    window = hub.join(Identity("session", "Deaf", Role.OPERATOR), "a-page", program.notify)
    async with asyncio.timeout(10.0 * CLOSE_FRAME_TIMEOUT):
        await program.run(window)


def test_reserved_places_are_free_when_all_others_are_taken() -> None:
    limit = ConnectionLimit(maximum=4, own_maximum=3)
    with ExitStack() as stack:

        def takes(identity: str, reserved: int = 0) -> bool:
            return stack.enter_context(limit.taken(identity, reserved))

        assert [takes("a") for _ in range(4)] == [True, True, True, False]
        assert [takes("b") for _ in range(2)] == [True, False]
        assert [takes("admin", 2) for _ in range(3)] == [True, True, False]
        # Who already has as many places has no more.
        assert not takes("a", 2)
    with limit.taken("b") as free:
        assert free


def test_admin_and_driver_get_in_while_viewers_hold_all_websockets(
    guarded: VirtualServer, file: AccessFile
) -> None:
    async def act(server: VirtualServer) -> None:
        async def cookie(role: Role) -> str:
            return await server.enter(file.give(role.value, role, time.time() + HOUR))

        async def welcome(cookie: str) -> bool:
            control = await server.control(cookie)
            await asyncio.sleep(0.1)
            crowd.append(control)
            assert control.socket.close_code in (None, LIMIT_CLOSE_CODE)
            return control.socket.close_code is None

        crowd: list[Control] = []
        driver, admin = await cookie(Role.OPERATOR), await cookie(Role.ADMIN)
        driving = await server.control(driver)
        await driving.wait(mood="ok")
        await driving.say("acquire")
        await driving.wait(mine=True)
        for _ in range(SOCKETS // SOCKETS_EACH):
            viewer = await cookie(Role.VIEWER)
            for _ in range(SOCKETS_EACH):
                crowd.append(await server.control(viewer))
        assert not await welcome(await cookie(Role.VIEWER))
        # An operator who does not drive has no place reserved.
        assert not await welcome(await cookie(Role.OPERATOR))
        assert await welcome(admin)
        assert await welcome(driver)
        await driving.say("stop")
        await driving.wait(stop="confirmed")

    guarded.run(act(guarded))


@pytest.fixture
def web() -> Iterator[WebServer]:
    with closing(listen("127.0.0.1", 0)) as listening:
        server = WebServer(Settings(port=listening.getsockname()[1]), listening)
        server.start()
        yield server
        server.stop()


def url_of(web: WebServer) -> str:
    return f"http://127.0.0.1:{web.stop_path.main_port}"


def test_pages_are_served_before_the_application_is_complete(web: WebServer) -> None:
    url = url_of(web)
    assert ask(f"{url}/")[0] == 200
    assert ask(f"{url}/static/page.js")[0] == 200
    assert ask(f"{url}/viser/{PROGRAM}")[0] == 200
    # Like the others it holds nothing secret; its websocket needs the cookie.
    assert ask(f"{url}/viser/")[0] == 200
    enter(url)
    # The sign-in waits for the event log.
    note = web.recorder.notes.get_nowait()
    assert note is not None
    assert (note.kind, note.outcome) == ("sign-in", "accepted")


@pytest.mark.parametrize(
    "head",
    [
        "GET / HTTP/1.1\nHost: 127.0.0.1:notaport",
        "GET / HTTP/1.1\nHost: 127.0.0.1:99999",
        "GET / HTTP/1.1\nHost: [::1",
        "POST /enter HTTP/1.1\nHost: 127.0.0.1\nContent-Length: 2\nTransfer-Encoding: chunked",
    ],
)
def test_invalid_requests_are_refused(web: WebServer, head: str) -> None:
    with socket.create_connection(("127.0.0.1", web.stop_path.main_port), 2.0) as connection:
        connection.sendall(head.replace("\n", "\r\n").encode() + b"\r\n\r\n")
        assert connection.recv(200).startswith(b"HTTP/1.1 400 Bad Request\r\n")


def test_client_that_hangs_up_in_its_body_leaves_no_traceback(
    web: WebServer, caplog: pytest.LogCaptureFixture
) -> None:
    url = url_of(web)
    head = (
        f"POST /enter HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: {url}\r\nContent-Length: 99\r\n\r\n{{"
    )
    with socket.create_connection(("127.0.0.1", int(url.rpartition(":")[2])), 2.0) as connection:
        connection.sendall(head.encode())
    assert ask(f"{url}/")[0] == 200
    web.stop()
    assert [record.getMessage() for record in caplog.records] == []


def test_other_requests_wait_for_the_application(web: WebServer) -> None:
    with ThreadPoolExecutor(1) as pool:
        response: Future[int] = pool.submit(lambda: ask(f"{url_of(web)}/health")[0])
        with pytest.raises(FutureTimeoutError):
            response.result(0.1)
        answer = PlainTextResponse("ok", 203)
        web.loop.call_soon_threadsafe(web.show, answer)
        with pytest.raises(FutureTimeoutError):
            response.result(0.1)
        web.loop.call_soon_threadsafe(web.complete)
        assert response.result(10.0) == 203


async def test_socket_of_the_page_opens_with_the_scene_and_its_requests_wait(
    web: WebServer,
) -> None:
    hub = Hub(time.monotonic)
    proxy = Proxy(hub, web.authenticator, cast("Any", None), 0, "")
    app = Starlette(routes=control_routes(hub, Budgets(hub.clock), web, proxy))
    path, cookie = f"/control?page={page_name()}", enter(url_of(web))
    opening = asyncio.create_task(websocket(url_of(web), path, cookie).__aenter__())
    await asyncio.sleep(0.1)
    assert not opening.done()
    web.loop.call_soon_threadsafe(web.show, app)
    socket = await asyncio.wait_for(opening, 5.0)
    await socket.send(json.dumps({"do": "heartbeat", "n": 7}))
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(socket.recv(), 0.1)
    web.loop.call_soon_threadsafe(web.complete)
    async with asyncio.timeout(5.0):
        while json.loads(await socket.recv()) != {"is": "echo", "n": 7}:
            pass
    await socket.close()


def test_requests_for_other_hosts_are_refused_at_once(web: WebServer) -> None:
    for path in ("/", "/health"):
        assert ask(f"{url_of(web)}{path}", Host="elsewhere.example")[0] == 403
