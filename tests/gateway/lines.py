"""Simple programs: JSON lines on the TCP port, or requests over HTTP."""

from __future__ import annotations

import json
import re
import socket
import time
from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from tests.browser.server import AppServer
from tests.gateway.client import ask

AT = re.compile(r"JSON lines on 127\.0\.0\.1:(\d+)")


class JsonProgram:
    """A simple program that sends and receives JSON texts; subclasses have connection and clock."""

    @abstractmethod
    def raw(self, data: bytes) -> None:
        """Send any text."""

    @abstractmethod
    def hear(self) -> dict[str, Any]:
        """Return the next message."""

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)

    def say(self, **request: Any) -> None:
        """Send a request."""
        self.raw(json.dumps(request).encode() + b"\n")

    def answer(self, **request: Any) -> dict[str, Any]:
        """Send a request and return its answer."""
        self.say(**request, id="x")
        while (heard := self.hear()).get("id") != "x":
            pass
        return heard

    def clear_stop(self) -> dict[str, Any]:
        """Clear the stop once that is possible, and return the answer."""
        for _ in range(1000):
            if self.answer(do="query")["clearable"]:
                return self.answer(do="clear_stop")
            self.sleep(0.02)
        raise AssertionError("the stop cannot be cleared")


class Lines(JsonProgram):
    """A program on the TCP port of a server with ``--lines``."""

    def __init__(self, server: AppServer) -> None:
        self.socket = socket.create_connection(("127.0.0.1", self.port(server)), timeout=5.0)
        # Otherwise the second of two requests waits until the first is acknowledged, up to 40 ms.
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.reader = self.socket.makefile("rb")

    @staticmethod
    def port(server: AppServer) -> int:
        """Return the TCP port of the server for programs."""
        match = AT.search(server.output)
        assert match is not None
        return int(match[1])

    def raw(self, data: bytes) -> None:
        self.socket.sendall(data)

    def hear(self) -> dict[str, Any]:
        line = self.reader.readline()
        assert line, "the line was closed"
        heard: dict[str, Any] = json.loads(line)
        return heard

    def ends(self) -> bool:
        with suppress(ConnectionError):
            while self.reader.readline():
                pass
        return True


@contextmanager
def speaking(server: AppServer, name: str = "Lines") -> Iterator[Lines]:
    """Connect a program and send its ``hello``."""
    lines = Lines(server)
    with lines.socket, lines.reader:
        lines.say(do="hello", name=name)
        assert lines.hear()["is"] == "welcome"
        yield lines


def post(server: AppServer, program: str = "a-test-that-posts", **request: Any) -> tuple[int, Any]:
    """Return status and answer of a single request over HTTP."""
    status, _, body = ask(
        f"{server.url}/api/v1/do", data=json.dumps(request).encode(), X_Program=program
    )
    return status, json.loads(body)
