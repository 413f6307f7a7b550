"""The extension ``importers``: meshes and scenes from files, at the start and by upload."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from katana450.arm.control.session import Session
    from katana450.arm.robot.initial_scene import InitialScene
    from katana450.server.web.http_api import RouteContext


def add_serve_options(parser: ArgumentParser) -> None:
    """Add the options for the initial scene to ``katana450 serve``."""
    parser.add_argument(
        "--scene",
        type=Path,
        metavar="FILE",
        help="initial scene: a scene.yaml with its meshes beside it, or a .zip of both",
    )
    parser.add_argument(
        "--object",
        dest="objects",
        action="append",
        default=[],
        metavar="FILE[@x,y,z][@SCALE]",
        help="additional object from a .wrl, .stl, .obj, .ply, .off, .glb, .gltf, .dae or "
        ".3mf file, with the files in its folder that it names, or from a .zip of them; at "
        "x,y,z in mm or else in front of the arm; can be repeated",
    )


def _initial_scene(options: Namespace, session: Callable[[], Session]) -> InitialScene | None:
    if options.scene is None and not options.objects:
        return None
    from katana450.extensions.importers.initial_scene import initial_scene

    return initial_scene(session(), options.scene, options.objects)


def _routes(context: RouteContext) -> list[BaseRoute]:
    from katana450.extensions.late_routes import LateRoutes
    from katana450.server.api.fields import ROOT

    def make() -> list[BaseRoute]:
        from katana450.extensions.importers.uploads import Uploads

        return Uploads(context.hub, context.authenticator, context.identity).routes()

    return LateRoutes([f"{ROOT}/mesh", f"{ROOT}/scene"], make).routes()


EXTENSION = Extension(
    "importers",
    serve=ServeExtension(
        add_serve_options,
        initial_scene=_initial_scene,
        routes=_routes,
        needs=("programs", "scene", "export", "objects"),
    ),
)
