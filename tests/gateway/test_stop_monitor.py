"""Test that a port of STOP counts as missing when it does not answer or cannot reach the arm."""

from __future__ import annotations

import asyncio
import math

import pytest

from katana450.server.service.stop_path import StopPath
from katana450.server.web import stop_monitor
from katana450.server.web.stop_monitor import watch_stop_path


async def problem_with(answer: bytes, arm_age: float) -> str:
    """Return the problem of a server of STOP that gives ``answer``, after several checks."""
    path, asked = StopPath(), asyncio.Semaphore(0)

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readline()
        asked.release()
        writer.write(answer)
        writer.close()

    async with await asyncio.start_server(serve, "127.0.0.1") as server:
        port = server.sockets[0].getsockname()[1]
        watch = asyncio.create_task(
            watch_stop_path(path, "127.0.0.1", port, lambda: arm_age, secure=False)
        )
        # The fourth request follows the judgement of the third answer.
        for _ in range(4):
            await asyncio.wait_for(asked.acquire(), 10.0)
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
    monkeypatch.setattr(stop_monitor, "CHECK_EVERY", 0.01)
    problem = asyncio.run(problem_with(answer, arm_age))
    assert bool(problem) != serves
