"""A real server that requires access links, and its access file."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from katana450.arm.control.lease import Role
from katana450.server.web.access_links import AccessFile
from tests.browser.server import APP, AppServer
from tests.gateway.client import HOUR, enter


class Site(NamedTuple):
    """A server that requires links, and its access file."""

    server: AppServer
    file: AccessFile

    def link(self, name: str, role: Role) -> str:
        """Return the token of a new link."""
        return self.file.give(name, role, time.time() + HOUR)

    def cookie(self, role: Role) -> str:
        """Return the cookie of a browser that has signed in with a new link."""
        return enter(self.server.url, self.link(role.value.title(), role))


@contextmanager
def open_site(folder: Path, *options: str, command: Sequence[str] = APP) -> Iterator[Site]:
    """Start a server with ``options``, whose access file is in ``folder``."""
    path = folder / "access.json"
    file = AccessFile.create(path)
    with AppServer((*command, "--access", str(path), *options)) as server:
        yield Site(server, file)
