"""Fixtures: the server of a test module, and a program that drives its arm."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from katana450.client import Client, connect
from katana450.server.api import requests
from tests.browser.server import APP, AppServer


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    """Start a server that also accepts JSON lines."""
    with AppServer((*APP, "--lines", "0")) as server:
        yield server


@pytest.fixture
def program(server: AppServer) -> Iterator[Client]:
    """Connect a program that holds the lease; its targets are dropped afterwards."""
    with connect(server.url, "Test") as program:
        program.clear_stop()
        program.ask(requests.Speed(value=1.0))
        yield program
        program.clear_stop()
        program.go(requests.Home())
        program.ask(requests.ReleaseLease())
