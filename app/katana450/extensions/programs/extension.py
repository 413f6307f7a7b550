"""The extension ``programs``: scripts that a server plans and runs."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from katana450.cli.serve_options import MIN_SILENCE, heartbeat_timeout
from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from katana450.server.service.runner import Runner
    from katana450.server.view.layer import ViewLayer
    from katana450.server.view.panel_folder import FolderContext, PanelFolder
    from katana450.server.web.http_api import RouteContext

TAB = "Programs"
"""Label of the panel's tab with the controls."""

OWNER_SILENCE, LONGEST_OWNER_SILENCE = 1.0, 10.0
"""[s] Default and longest heartbeat timeout of a program's owner, after which the program ends."""


def add_serve_options(parser: ArgumentParser) -> None:
    """Add the options for programs to ``katana450 serve``."""
    parser.add_argument(
        "--owner-silence",
        type=_owner_silence,
        default=OWNER_SILENCE,
        metavar="SECONDS",
        help="heartbeat timeout of a program's owner, after which the program ends "
        f"({MIN_SILENCE:g} to {LONGEST_OWNER_SILENCE:g}, default: %(default)s)",
    )
    parser.add_argument(
        "--no-unattended",
        action="store_true",
        help="refuse programs that are to run without heartbeats of their owner",
    )
    parser.add_argument(
        "--no-idle-planning",
        action="store_true",
        help="do not plan the scripts of the library while nobody uses the server",
    )
    parser.add_argument(
        "--programs",
        type=Path,
        metavar="DIR",
        help="folder of scripts for the panel; taught scripts are saved there too",
    )


def _owner_silence(text: str) -> float:
    return heartbeat_timeout(text, LONGEST_OWNER_SILENCE)


def _runner() -> type[Runner]:
    from katana450.extensions.programs.server.program_runner import ProgramRunner

    return ProgramRunner


def _folder(context: FolderContext) -> PanelFolder | None:
    from katana450.extensions.programs.script_files import Scripts
    from katana450.extensions.programs.server.panel import ProgramsPanel
    from katana450.extensions.programs.server.panel_access import PanelAccess
    from katana450.extensions.programs.server.program_runner import ProgramRunner

    runner = context.hub.runner
    if context.robot.arm is None or not isinstance(runner, ProgramRunner):
        # Scripts move tools, and another extension may provide the only runner of this server.
        return None
    with context.tabs.tab(TAB):
        return ProgramsPanel(
            context.server,
            context.robot,
            PanelAccess(runner, context.hub, context.call),
            Scripts(context.options.programs),
            context.gestures,
            context.state,
            lambda: context.hub.present().session,
        )


def _view_layer(_options: Namespace) -> ViewLayer:
    from katana450.extensions.programs.server.traces import TracesLayer

    return TracesLayer()


def _routes(context: RouteContext) -> list[Any]:
    from katana450.extensions.programs.server.script_routes import routes

    return routes(context)


EXTENSION = Extension(
    "programs",
    serve=ServeExtension(
        add_serve_options,
        view_layer=_view_layer,
        routes=_routes,
        runner=_runner,
        folder=_folder,
        # Previews show the water.
        needs=("water",),
    ),
)
