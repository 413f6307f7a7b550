"""A program's hand on the server of a file of tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app.api import requests
from app.client import Client, connect
from tests.browser.server import AppServer


@pytest.fixture
def program(server: AppServer) -> Iterator[Client]:
    """A program that holds the arm; what it was told to do is forgotten afterwards."""
    with connect(server.url, "Test") as program:
        program.ask(requests.Reset())
        program.ask(requests.Speed(value=1.0))
        yield program
        program.ask(requests.Reset())
        program.go(requests.Home())
        program.ask(requests.Release())
