"""The web server serves the pages before the application is complete, and then everything."""

from __future__ import annotations

import asyncio
import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import closing
from typing import Any, cast

import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse

from katana450.assembly.gateway import control_routes
from katana450.assembly.web_server import WebServer
from katana450.server.service.budget import Budgets
from katana450.server.service.hub import Hub
from katana450.server.viser_bridge.proxy import Proxy
from katana450.server.viser_bridge.viser_page import PROGRAM
from katana450.server.web.listen import listen
from katana450.settings import Settings
from tests.gateway.client import ask, enter, page_name, websocket


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


def _first_line(url: str, head: str) -> str:
    """Return the first line of the answer to a request with ``head``, and hang up."""
    with socket.create_connection(("127.0.0.1", int(url.rpartition(":")[2])), 2.0) as connection:
        connection.sendall(head.replace("\n", "\r\n").encode() + b"\r\n\r\n")
        return connection.recv(200).partition(b"\r\n")[0].decode()


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
    assert _first_line(url_of(web), head) == "HTTP/1.1 400 Bad Request"


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
        asked: Future[int] = pool.submit(lambda: ask(f"{url_of(web)}/health")[0])
        with pytest.raises(FutureTimeoutError):
            asked.result(0.1)
        answer = PlainTextResponse("ok", 203)
        web.loop.call_soon_threadsafe(web.show, answer)
        with pytest.raises(FutureTimeoutError):
            asked.result(0.1)
        web.loop.call_soon_threadsafe(web.complete)
        assert asked.result(10.0) == 203


def test_socket_of_the_page_opens_with_the_scene_and_its_requests_wait(web: WebServer) -> None:
    hub = Hub(time.monotonic)
    proxy = Proxy(hub, web.authenticator, cast("Any", None), 0, "")
    app = Starlette(routes=control_routes(hub, Budgets(hub.clock), web, proxy))

    async def trial() -> None:
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

    asyncio.run(trial())


def test_requests_for_other_hosts_are_refused_at_once(web: WebServer) -> None:
    for path in ("/", "/health"):
        assert ask(f"{url_of(web)}{path}", Host="elsewhere.example")[0] == 403


def test_pages_need_neither_numpy_nor_viser() -> None:
    code = (
        "import sys, katana450.assembly.web_server\n"
        "print(*sorted({'numpy', 'viser', 'trimesh'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert not done.stdout.strip()
