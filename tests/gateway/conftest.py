"""Fixtures: the server of the test modules, and a program that drives its arm."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from katana450.client import Client, connect
from katana450.server.api import requests
from tests.browser.server import APP, AppServer
from tests.browser.shared_server import SharedServer


@pytest.fixture(scope="package")
def shared_server() -> Iterator[SharedServer]:
    """Return the server of the modules of this folder, which also accepts JSON lines."""
    with SharedServer((*APP, "--lines", "0")) as shared_server:
        yield shared_server


@pytest.fixture(scope="module")
def server(shared_server: SharedServer) -> AppServer:
    """Return the server in the state of a new one."""
    return shared_server.as_new()


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
