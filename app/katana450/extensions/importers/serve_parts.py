"""Initial scene and uploads of ``katana450 serve``, from files.

It loads nothing heavy before a file is read.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from katana450.arm.control.session.session import Session
    from katana450.arm.robot.object_meshes import InitialScene
    from katana450.server.web.http_api import RouteContext


def add_serve_options(parser: ArgumentParser) -> None:
    """Add the option for the initial scene to ``katana450 serve``."""
    parser.add_argument(
        "--scene",
        type=Path,
        metavar="FILE",
        help="initial scene: a scene.yaml with its meshes beside it, or a .zip of both",
    )


def chosen_scene(options: Namespace, session: Callable[[], Session]) -> InitialScene | None:
    """Return the scene of ``--scene``; None without one. Raises KatanaError."""
    if options.scene is None:
        return None
    from katana450.extensions.importers.formats.scene_file import initial_scene

    return initial_scene(session(), options.scene)


def upload_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes that upload meshes and scenes."""
    from katana450.extensions.late_routes import LateRoutes
    from katana450.server.api.fields import ROOT

    def make() -> list[BaseRoute]:
        from katana450.extensions.importers.uploads import Uploads

        return Uploads(context).routes()

    return LateRoutes([f"{ROOT}/mesh", f"{ROOT}/scene"], make).routes()
