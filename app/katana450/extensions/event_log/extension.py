"""The extension ``event_log``: the log of who did what on disk, and its command."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from katana450.extension import CliCommand, Extension, ServeExtension
from katana450.extensions.event_log.log_options import add_log_options

if TYPE_CHECKING:
    from katana450.server.service.recorder import Recorder
    from katana450.server.service.server_log import ServerLog


def add_serve_options(parser: ArgumentParser) -> None:
    """Add the options of ``katana450 serve`` to ``parser``."""
    logged = parser.add_mutually_exclusive_group()
    logged.add_argument(
        "--log",
        type=Path,
        metavar="FOLDER",
        help="folder of the event log (default: one for each port, named at the start)",
    )
    logged.add_argument("--no-log", action="store_true", help="write no event log")


def _server_log(options: Namespace, port: int) -> ServerLog | None:
    if options.no_log:
        return None
    from katana450.extensions.event_log.disk_log import DiskLog, default_folder

    return DiskLog(options.log or default_folder(port), port)


def _send_records(
    options: Namespace, recorder: Recorder, pipe: Connection
) -> Callable[[], None] | None:
    if options.no_log:
        return None
    from katana450.extensions.event_log.record_sender import RecordSender

    return RecordSender(recorder, pipe).close


def _log(options: Namespace) -> int:
    from katana450.extensions.event_log.log_command import log

    return log(options)


EXTENSION = Extension(
    "event_log",
    (CliCommand("log", "show the event log of a server", add_log_options, _log),),
    ServeExtension(add_serve_options, server_log=_server_log, send_records=_send_records),
)
