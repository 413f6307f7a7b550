"""Test the decisions of the server of STOP, without a socket and without an arm."""

from __future__ import annotations

import asyncio
import json
import math
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import h11
import pytest

from katana450.arm.control.lease import Role
from katana450.arm.control.state.stop_cause import StopCause, pressed
from katana450.arm.runtime.pipes.stop_messages import NO_STATE, StopPress, StopStatus
from katana450.arm.runtime.pipes.stop_pipe import StopPipe
from katana450.server.service import stop_path
from katana450.server.service.stop_path import StopPath, watch_stop_path
from katana450.server.web import stop_server
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import LOOPBACK_NAMES, Address, Authenticator
from katana450.server.web.stop_server import BURST, StopServer
from tests.gateway.client import HOUR

CLIENT = ("127.0.0.1", 5000)
RUNS = StopStatus(None, ())
STOPPED = StopStatus(pressed("Anna", "a", "one", 1.0), ("one",))


class FakePipe:
    """A pipe to an arm that executes no press."""

    def __init__(self) -> None:
        self.status: StopStatus | None = RUNS
        self.age = 0.0
        self.presses: list[StopPress] = []

    def press(self, press: StopPress) -> None:
        self.presses.append(press)

    async def executed(self, press: str, timeout: float) -> StopCause | None:
        assert (press, timeout) == (self.presses[-1].cause.press, stop_server.CONFIRM_TIMEOUT)
        return None


class Port:
    """The server of STOP, with two viewers."""

    def __init__(self, folder: Path, listening: socket.socket) -> None:
        file = AccessFile.create(folder / "access.json")
        self.vera, self.otto = (
            file.give(name, Role.VIEWER, time.time() + HOUR) for name in ("Vera", "Otto")
        )
        self.file = file
        address = Address(LOOPBACK_NAMES, any_address=False, secure=False)
        authenticator = Authenticator(file, 8080, address)
        self.pipe = FakePipe()
        pipe = cast(StopPipe, self.pipe)
        self.server = StopServer(pipe, authenticator, address, 8080, Acceptor(listening))

    async def stop(self, token: str, press: str = "two") -> tuple[int, str]:
        """Return status and stage of a STOP, which is answered at once."""
        headers = [("host", "localhost"), ("authorization", f"Bearer {token}")]
        target = f"/api/v1/stop?press={press}"
        request = h11.Request(method="POST", target=target, headers=headers)
        async with asyncio.timeout(5.0):
            reply = await self.server.reply(request, CLIENT)
        stage: str = json.loads(reply.body)["stop"] if reply.status < 400 else ""
        return reply.status, stage

    def number(self, token: str) -> str:
        """Return the number of the link of ``token``."""
        grant = self.file.check(token, time.time())
        assert grant is not None
        return grant[0]

    @property
    def sent(self) -> list[str]:
        """The presses that the arm got."""
        return [press.cause.press for press in self.pipe.presses]


@pytest.fixture
def port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Port]:
    # A delayed answer does not come during the test.
    monkeypatch.setattr(stop_server, "DELAY", math.inf)
    with socket.socket() as listening:
        yield Port(tmp_path, listening)


@pytest.mark.parametrize(
    "more",
    [
        [("host", "127.0.0.1:notaport")],
        [("host", "localhost"), ("content-length", "2"), ("transfer-encoding", "chunked")],
    ],
)
def test_invalid_requests_are_refused(port: Port, more: list[tuple[str, str]]) -> None:
    request = h11.Request(method="POST", target="/api/v1/stop", headers=more)
    reply = asyncio.run(port.server.reply(request, CLIENT))
    assert reply.status == 400
    assert json.loads(reply.body)["code"] == "malformed"
    assert port.sent == []


async def exhaust(port: Port, token: str) -> None:
    """Send STOP as ``token`` until an answer is delayed."""
    for _ in range(10 * round(BURST)):
        press = asyncio.create_task(port.stop(token))
        done, _ = await asyncio.wait([press], timeout=0.5)
        if not done:
            press.cancel()
            return
    raise AssertionError("No answer was delayed.")


async def test_flood_of_one_link_delays_no_press_of_another(port: Port) -> None:
    port.pipe.status = STOPPED
    await exhaust(port, port.vera)
    assert await port.stop(port.otto) == (200, "confirmed")


async def test_press_that_finds_the_arm_running_is_never_delayed(port: Port) -> None:
    port.pipe.status = STOPPED
    await exhaust(port, port.vera)
    port.pipe.status, sent = RUNS, len(port.pipe.presses)
    assert await port.stop(port.vera, "three") == (202, "requested")
    assert [press.cause.press for press in port.pipe.presses[sent:]] == ["three"]


async def test_delayed_press_counts_once_the_stop_is_cleared(
    port: Port, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(port.server._often, "_rate", 0.0)
    port.pipe.status = STOPPED
    await exhaust(port, port.vera)
    monkeypatch.setattr(stop_server, "DELAY", 0.05)
    sent = len(port.sent)
    press = asyncio.create_task(port.stop(port.vera, "three"))
    await asyncio.sleep(0.0)
    port.pipe.status = RUNS
    assert await press == (202, "requested")
    assert port.sent[sent:] == ["three"]


async def test_repeated_press_whose_stop_was_cleared_is_not_requested_again(port: Port) -> None:
    port.pipe.status = StopStatus(None, ("two",))
    assert await port.stop(port.vera, "two") == (200, "cleared")
    assert port.sent == []
    assert await port.stop(port.vera, "three") == (202, "requested")


async def test_old_status_confirms_nothing(port: Port) -> None:
    port.pipe.status, port.pipe.age = STOPPED, NO_STATE
    assert await port.stop(port.vera) == (202, "requested")
    port.pipe.age = 0.0
    assert await port.stop(port.vera) == (200, "confirmed")


async def test_wrong_tokens_of_an_address_are_delayed_and_send_nothing(port: Port) -> None:
    assert await port.stop("wrong") == (401, "")
    await exhaust(port, "wrong")
    assert port.pipe.presses == []
    # They do not use up the rate of a link.
    assert await port.stop(port.vera) == (202, "requested")


async def problem_with(answer: bytes, arm_age: float) -> str:
    """Return the problem of a server of STOP that gives ``answer``, after several checks."""
    path, checks = StopPath(), asyncio.Semaphore(0)

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readline()
        checks.release()
        writer.write(answer)
        writer.close()

    async with await asyncio.start_server(serve, "127.0.0.1") as server:
        port = server.sockets[0].getsockname()[1]
        watch = asyncio.create_task(
            watch_stop_path(path, "127.0.0.1", port, lambda: arm_age, secure=False)
        )
        # The fourth request follows the judgement of the third answer.
        for _ in range(4):
            await asyncio.wait_for(checks.acquire(), 10.0)
        watch.cancel()
        await asyncio.gather(watch, return_exceptions=True)
    return path.problem


@pytest.mark.parametrize(
    ("answer", "arm_age", "serves"),
    [
        (b"HTTP/1.1 200 OK\r\n\r\n", 0.0, True),
        (b"HTTP/1.1 503 Service Unavailable\r\n\r\n", 0.1, False),
        (b"HTTP/1.1 503 Service Unavailable\r\n\r\n", math.inf, True),
        (b"HTTP/1.1 500 Internal Server Error\r\n\r\n", math.inf, False),
        (b"", math.inf, False),
    ],
)
def test_port_serves_stop_only_if_it_reaches_the_arm(
    monkeypatch: pytest.MonkeyPatch, answer: bytes, arm_age: float, serves: bool
) -> None:
    monkeypatch.setattr(stop_path, "CHECK_EVERY", 0.01)
    problem = asyncio.run(problem_with(answer, arm_age))
    assert bool(problem) != serves
