"""Fixtures: a server in this process, a server in others, and programs that drive their arms."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.arm.control.session.session import Session
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.client import Client
from katana450.resources import URDF_PATH
from katana450.server.web.access_links import AccessFile
from katana450.settings import Settings
from tests.browser.server import APP, AppServer
from tests.browser.shared_server import SharedServer
from tests.gateway.test_hub import Table
from tests.gateway.virtual import VirtualServer


@pytest.fixture(scope="session")
def described() -> DescribedRobot:
    """Return the robot with the session that `serve` makes, contacts included."""
    return find_robot(Settings(), URDF_PATH, None)


@pytest.fixture
def local(described: DescribedRobot) -> Iterator[VirtualServer]:
    """Return a new server in this process. Its clock is that of the test."""
    with VirtualServer(described) as server:
        yield server


@pytest.fixture
def file(tmp_path: Path) -> AccessFile:
    """Return a new file of access links."""
    return AccessFile.create(tmp_path / "access.json")


@pytest.fixture
def guarded(described: DescribedRobot, file: AccessFile) -> Iterator[VirtualServer]:
    """Return a new server in this process that requires links."""
    with VirtualServer(described, access=file) as server:
        yield server


@pytest.fixture
def table(session: Session) -> Table:
    """Return a hub with its arm at rest, without a server."""
    return Table(session.begin(session.ready, 0.0, 0.0))


@pytest.fixture
def program(local: VirtualServer) -> Iterator[Client]:
    """Connect a program to that server; it holds the lease."""
    with local.connect("Test") as program:
        program.clear_stop()
        yield program


@pytest.fixture(scope="package")
def shared_server() -> Iterator[SharedServer]:
    """Return the server of the modules of this folder, which also accepts JSON lines."""
    with SharedServer((*APP, "--lines", "0")) as shared_server:
        yield shared_server


@pytest.fixture(scope="module")
def server(shared_server: SharedServer) -> AppServer:
    """Return the server in the state of a new one."""
    return shared_server.as_new()
