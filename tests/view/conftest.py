"""A viser server without any page."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator

import pytest
import viser


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    """Open a viser server on a free port of this machine."""
    with contextlib.redirect_stdout(io.StringIO()):
        opened = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        yield opened
        opened.stop()
