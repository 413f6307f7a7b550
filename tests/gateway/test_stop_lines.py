"""Test STOP as two JSON lines on the port of STOP, with a real server."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path

import pytest

from katana450.arm.control.lease import Role
from katana450.client import connect
from katana450.client.client import Client
from katana450.server.api import answers, requests
from katana450.server.web.access_links import AccessFile
from katana450.server.web.stop_server import MAX_HEAD_BYTES
from tests.browser.server import APP, AppServer
from tests.gateway.client import HOUR
from tests.gateway.test_watchdogs import under_way

HELLO = b'{"do": "hello", "name": "Cell"}\n'
STOP = b'{"do": "stop"}\n'


def answer(server: AppServer, *parts: bytes) -> dict[str, str]:
    """Send ``parts`` one after the other; return the answer before the connection is closed."""
    host, port = server.stop_url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=10.0) as line:
        for part in parts:
            line.sendall(part)
            time.sleep(0.05)
        with line.makefile("rb") as stream:
            row: dict[str, str] = json.loads(stream.readline())
            assert stream.read() == b""
    return row


def stopped(program: Client) -> str:
    """Return the reason of the stop as soon as the main port has heard of it from the arm."""
    deadline = time.monotonic() + 5.0
    while (why := program.query(answers.State).stopped) is None:
        assert time.monotonic() < deadline
    return why


def test_two_lines_stop_a_moving_arm(server: AppServer) -> None:
    with connect(server.url, "Driver") as program:
        under_way(program)
        confirmed = {"stop": "confirmed", "why": "Cell pressed STOP."}
        # Cut anywhere, as TCP may do.
        assert answer(server, HELLO[:9], HELLO[9:] + STOP[:3], STOP[3:]) == confirmed
        assert stopped(program) == "Cell pressed STOP."
        program.clear_stop()
        program.ask(requests.ReleaseLease())


@pytest.mark.parametrize("end", [pytest.param(b"\n", marks=pytest.mark.long), b""])
def test_sender_that_ends_its_half_is_answered(server: AppServer, end: bytes) -> None:
    host, port = server.stop_url.removeprefix("http://").split(":")
    with connect(server.url, "Driver") as program:
        under_way(program)
        with socket.create_connection((host, int(port)), timeout=10.0) as line:
            line.sendall(HELLO + STOP.rstrip() + end)
            line.shutdown(socket.SHUT_WR)
            with line.makefile("rb") as stream:
                assert json.loads(stream.readline())["stop"] == "confirmed"
        assert stopped(program) == "Cell pressed STOP."
        program.clear_stop()
        program.ask(requests.ReleaseLease())


def test_other_lines_are_refused_and_stop_nothing(server: AppServer) -> None:
    for lines, why in (
        (HELLO + HELLO, "hello"),
        (STOP + HELLO, "stop"),
        (b'{"do": "hello"}\n' + STOP, "name"),
        (b"{\n{\n", "truncated"),
        (b'{"do": "hello", "name": "\xff"}\n' + STOP, "utf-8"),
        (HELLO + b'{"do": "stop", "press": 1}\n', "press"),
        (b"{" + MAX_HEAD_BYTES * b" ", "too long"),
    ):
        refused = answer(server, lines)
        assert refused["stop"] == "refused"
        assert why in refused["why"]
        assert '{"do": "stop"}' in refused["why"]
    with connect(server.url, "Watcher") as program:
        assert program.query(answers.State).stopped is None


@pytest.mark.long
def test_lines_need_a_token_where_pages_need_one(tmp_path: Path) -> None:
    path = tmp_path / "access.json"
    token = AccessFile.create(path).give("Vera", Role.VIEWER, time.time() + HOUR)
    with AppServer((*APP, "--access", str(path))) as server:
        assert answer(server, HELLO, STOP) == {
            "stop": "refused",
            "why": "A token is required. `katana450 access give` makes one.",
        }
        hello = json.dumps({"do": "hello", "name": "Cell", "token": token}).encode()
        assert answer(server, hello + b"\n", STOP)["stop"] == "confirmed"
