"""The event log of one server, written by the process that starts the others and outlives them."""

from __future__ import annotations

import os
from argparse import Namespace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from katana450.extensions.event_log.records import Record, record
from katana450.extensions.event_log.writer import LogWriter
from katana450.platform_support import state_folder
from katana450.server.service.server_log import ServerLog

CLOSE_TIMEOUT = 2.0
"""[s] Time in which a slow disk may take the last records."""


def default_folder(port: int) -> Path:
    """Return the folder of the event log of the server on ``port``."""
    return state_folder() / "katana450" / "events" / f"port-{port}"


class DiskLog(ServerLog):
    """The event log of this server in a folder."""

    def __init__(self, folder: Path, port: int) -> None:
        """Write to ``folder``, first the start of the server on ``port``."""
        self._writer = LogWriter(folder)
        self._writer.put(_by_server("start", {"port": port, "pid": os.getpid()}))

    @property
    def description(self) -> tuple[str, ...]:
        """The folder, as a line for the terminal."""
        return (f"Event log: {self._writer.folder}",)

    def attach(self, pipe: Connection) -> None:
        """Write the records that another process sends by ``pipe``."""
        self._writer.attach(pipe)

    def restart(self, process: str, status: int | None) -> None:
        """Record that ``process`` ended with ``status``, and is started again."""
        self._writer.put(_by_server("restart", {"process": process, "status": status}))

    def close(self, *, requested: bool) -> None:
        """Record the end of the server, and write what waits. ``requested``: by a signal."""
        what = {"cause": "requested" if requested else "the server could not start, or failed"}
        self._writer.close(_by_server("end", what), CLOSE_TIMEOUT)


def disk_log(options: Namespace, port: int) -> DiskLog | None:
    """Return the event log of the server on ``port``; None if the options choose none."""
    return None if options.no_log else DiskLog(options.log or default_folder(port), port)


def _by_server(kind: str, what: dict[str, Any]) -> Record:
    return record(kind, what, who={"name": "the server", "channel": "server"})
