"""The extension ``recording``: what the arm does is recorded, and a command about recordings."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from katana450.extension import (
    CliCommand,
    Extension,
    ExtraProcess,
    ServeExtension,
    ServerFacts,
    TickSender,
)
from katana450.extensions.recording.record_options import add_record_options

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from katana450.server.web.http_api import RouteContext


def add_serve_options(parser: ArgumentParser) -> None:
    """Add the options of ``katana450 serve`` to ``parser``."""
    recorded = parser.add_mutually_exclusive_group()
    recorded.add_argument(
        "--record",
        type=Path,
        metavar="FOLDER",
        help="folder for the last ten minutes of motion (default: one for each port, named at the "
        "start)",
    )
    recorded.add_argument("--no-record", action="store_true", help="record nothing")


def _process(options: Namespace, facts: ServerFacts) -> ExtraProcess | None:
    if options.no_record:
        return None
    from katana450.extensions.recording.live.recorder import RecorderConfig, run_recorder
    from katana450.extensions.recording.places import default_folder

    folder = options.record or default_folder(facts.port)
    config = RecorderConfig(facts, folder)
    return ExtraProcess(
        "katana450 rec",
        "The process that records",
        run_recorder,
        config,
        f"Recording: the last ten minutes of motion are kept in {folder}",
    )


def _routes(context: RouteContext) -> list[BaseRoute]:
    from katana450.extensions.recording.live.route import recording_route
    from katana450.extensions.recording.places import default_folder

    options = context.options
    folder: Path | None = None
    if options is not None and not options.no_record:
        folder = options.record or default_folder(context.hub.stop_path.main_port)
    return [recording_route(context, folder)]


def _tick_sender(options: Namespace) -> TickSender | None:
    if options.no_record:
        return None
    from katana450.extensions.recording.live.record_end import RecordEnd

    return RecordEnd()


def _record(options: Namespace) -> int:
    from katana450.extensions.recording.files.record_command import record

    return record(options)


EXTENSION = Extension(
    "recording",
    (CliCommand("record", "keep, verify, repair and cut recordings", add_record_options, _record),),
    ServeExtension(
        add_serve_options,
        routes=_routes,
        process=_process,
        tick_sender=_tick_sender,
        needs=("programs",),
    ),
)
