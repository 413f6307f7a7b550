"""Fixture: the server of a test module."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.browser.server import APP, AppServer


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    """Start a server, which stops an arm whose driver falls silent."""
    with AppServer(APP) as server:
        yield server
