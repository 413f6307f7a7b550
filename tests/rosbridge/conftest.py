"""Fixture: the server of the test modules."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.browser.server import APP, AppServer
from tests.browser.shared_server import SharedServer


@pytest.fixture(scope="package")
def shared_server() -> Iterator[SharedServer]:
    """Return the server of the modules, which stops an arm whose driver falls silent."""
    with SharedServer(APP) as shared_server:
        yield shared_server


@pytest.fixture(scope="module")
def server(shared_server: SharedServer) -> AppServer:
    """Return the server in the state of a new one."""
    return shared_server.as_new()
