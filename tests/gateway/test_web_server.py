"""The web server serves the pages before the application is complete, and then everything."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import closing

import pytest
from starlette.responses import PlainTextResponse

from katana450.assembly.web_server import WebServer
from katana450.server.viser_bridge.viser_page import PROGRAM
from katana450.server.web.listen import listen
from katana450.settings import Settings
from tests.gateway.client import ask, enter


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


def test_other_requests_wait_for_the_application(web: WebServer) -> None:
    with ThreadPoolExecutor(1) as pool:
        asked: Future[int] = pool.submit(lambda: ask(f"{url_of(web)}/health")[0])
        with pytest.raises(FutureTimeoutError):
            asked.result(0.3)
        answer = PlainTextResponse("ok", 203)
        web.loop.call_soon_threadsafe(web.show, answer)
        with pytest.raises(FutureTimeoutError):
            asked.result(0.3)
        web.loop.call_soon_threadsafe(web.complete)
        assert asked.result(10.0) == 203


@pytest.mark.parametrize("path", ["/control", "/stop", "/leave"])
def test_our_page_waits_only_for_the_scene(web: WebServer, path: str) -> None:
    with ThreadPoolExecutor(1) as pool:
        asked: Future[int] = pool.submit(lambda: ask(f"{url_of(web)}{path}")[0])
        with pytest.raises(FutureTimeoutError):
            asked.result(0.3)
        web.loop.call_soon_threadsafe(web.show, PlainTextResponse("ok", 203))
        assert asked.result(10.0) == 203


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
