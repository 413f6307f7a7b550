"""Parts of ``katana450 serve`` that record, and the choice among the commands on recordings.

It loads nothing heavy before it is used.
"""

from __future__ import annotations

import os
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from katana450.arm.runtime.pipes.private_listener import PrivateAddress
from katana450.errors import ConfigurationError
from katana450.extension import ExtraProcess, ServerFacts, TickSender

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from katana450.extensions.recording.live.recorder_link import RecorderLink
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
    parser.add_argument(
        "--episodes",
        type=Path,
        metavar="FOLDER",
        help="folder for episodes, which people mark on the page (default: one for each port)",
    )


def process(options: Namespace, facts: ServerFacts) -> ExtraProcess | None:
    """Return the process that records; None if the options choose none.

    Raises ConfigurationError.
    """
    if options.no_record:
        if options.episodes:
            raise ConfigurationError("--episodes needs the recording: leave out --no-record.")
        return None
    from katana450.extensions.recording.folders import default_folder
    from katana450.extensions.recording.live.recorder import RecorderConfig, run_recorder

    # The page's server, which gets the options too, finds the process by it.
    options.recorder = PrivateAddress(f"{facts.address.name}-recorder", os.urandom(32))
    folder = options.record or default_folder(facts.port)
    episodes = _episodes_folder(options, facts.port)
    names = tuple(name for name, _ in options.camera)
    cameras = getattr(options, "camera_process", None)
    config = RecorderConfig(facts, folder, episodes, options.recorder, names, cameras)
    return ExtraProcess(
        "katana450 rec",
        "The process that records",
        run_recorder,
        config,
        f"Recording: the last ten minutes of motion are kept in {folder}, episodes in {episodes}",
    )


def _episodes_folder(options: Namespace, port: int) -> Path:
    """Return the folder of the episodes of the server on ``port``."""
    from katana450.extensions.recording.folders import default_folder

    folder: Path = options.episodes or default_folder(port, "episodes")
    # Each process of the server may have another working directory.
    return folder.absolute()


def routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes of recordings, play back and episodes."""
    from katana450.extensions.late_routes import LateRoutes
    from katana450.server.api.fields import ROOT

    options = context.options
    episodes: Path | None = None
    link: RecorderLink | None = None
    if options is not None and not options.no_record:
        episodes = _episodes_folder(options, context.hub.stop_path.main_port)
    address = getattr(options, "recorder", None)
    if address is not None:
        from katana450.extensions.programs.server.program_runner import ProgramRunner
        from katana450.extensions.recording.live.recorder_link import RecorderLink

        link = RecorderLink(context.hub, address)
        if isinstance(context.hub.runner, ProgramRunner):
            context.hub.runner.follow_run = link.note

    def make() -> list[BaseRoute]:
        from katana450.extensions.recording.episodes.routes import EpisodeRoutes
        from katana450.extensions.recording.live.jobs import RecordingRoutes
        from katana450.extensions.recording.playback.routes import PlaybackRoutes
        from katana450.extensions.recording.playback.store import store_of

        store = store_of(context.hub, options)
        late_routes: list[BaseRoute] = [*RecordingRoutes(context, store).routes()]
        late_routes += PlaybackRoutes(context, store).routes()
        if episodes is not None and link is not None:
            late_routes += EpisodeRoutes(context, episodes, link).routes()
        return late_routes

    names = [f"{ROOT}/{name}" for name in ("recording", "playback", "episodes")]
    return LateRoutes(names, make).routes()


def tick_sender(options: Namespace) -> TickSender | None:
    """Return the sender of ticks to the process that records; None without it."""
    if options.no_record:
        return None
    from katana450.extensions.recording.live.record_end import RecordEnd

    return RecordEnd()


def record(options: Namespace) -> int:
    """Execute ``katana450 record``; return the exit status."""
    if options.act == "again":
        from katana450.extensions.recording.run_again import again

        return again(options)
    from katana450.extensions.recording.files.record_command import record as keep

    return keep(options)
