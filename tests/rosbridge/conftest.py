"""Fixtures: the server of the test modules, and a client of it."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator

import pytest

from tests.browser.server import APP, AppServer
from tests.browser.shared_server import SharedServer
from tests.rosbridge.ros_client import RosClient, ros


@pytest.fixture(scope="package")
def shared_server() -> Iterator[SharedServer]:
    """Return the server of the modules, which stops an arm whose driver falls silent."""
    with SharedServer(APP) as shared_server:
        yield shared_server


@pytest.fixture(scope="module")
def server(shared_server: SharedServer) -> AppServer:
    """Return the server in the state of a new one."""
    return shared_server.as_new()


@pytest.fixture
def anyio_backend() -> str:
    """Return the event loop of the tests that are coroutines."""
    return "asyncio"


@pytest.fixture
async def client(server: AppServer) -> AsyncIterator[RosClient]:
    """Return a client that watches the state."""
    async with ros(server.url) as client:
        yield client
