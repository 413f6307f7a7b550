"""Parts of ``katana450 serve`` for cameras. Nothing heavy is loaded before it is used."""

from __future__ import annotations

import os
import re
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from functools import partial
from threading import Thread
from typing import TYPE_CHECKING

from katana450.arm.runtime.pipes.private_listener import PrivateAddress
from katana450.errors import ConfigurationError
from katana450.extension import ExtraProcess, ServerFacts

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from katana450.server.web.http_api import RouteContext

NAME = re.compile(r"[A-Za-z0-9_-]{1,20}")

MAX_CAMERAS = 4

ENTRY = "cameras"
"""Name of the list of cameras in the status of all pages."""


def add_serve_options(parser: ArgumentParser) -> None:
    """Add the options of ``katana450 serve`` to ``parser``."""
    parser.add_argument(
        "--camera",
        type=_named_source,
        action="append",
        default=[],
        metavar="NAME=SOURCE",
        help="show a camera beside the scene: an http address of MJPEG, `browser` for one that a "
        "person shares on the page, with the extra `pictures` simulated:wrist or "
        "simulated:overview, or with the extra `cameras` a device (0, /dev/video0), an rtsp "
        f"address or a film; up to {MAX_CAMERAS}",
    )
    parser.add_argument(
        "--cameras-for",
        choices=("everybody", "drivers"),
        default="everybody",
        help="who sees the cameras (default: everybody who may open the page)",
    )


def _named_source(text: str) -> tuple[str, str]:
    name, _, source = text.partition("=")
    if not NAME.fullmatch(name) or not source:
        raise ArgumentTypeError(
            f"{text!r} is not NAME=SOURCE, with a NAME of up to 20 letters, digits, - and _, as "
            "in table=http://192.168.1.20:8080/stream"
        )
    return name, source


def process(options: Namespace, facts: ServerFacts) -> ExtraProcess | None:
    """Return the process that reads the cameras; None without any. Raises ConfigurationError."""
    sources = dict(options.camera)
    if not sources:
        return None
    if len(sources) < len(options.camera):
        raise ConfigurationError("Two cameras have the same name. Give each another --camera NAME.")
    if len(sources) > MAX_CAMERAS:
        raise ConfigurationError(f"There are {len(sources)} cameras, of at most {MAX_CAMERAS}.")
    from katana450.extensions.cameras.camera_process import CamerasConfig, run_cameras
    from katana450.extensions.cameras.simulated import VIEWS
    from katana450.extensions.cameras.sources import EXTRA, PURPOSE, SIMULATED, needs_extra
    from katana450.extras import require

    for source in sources.values():
        if source.startswith(SIMULATED) and source.removeprefix(SIMULATED) not in VIEWS:
            views = " or ".join(SIMULATED + view for view in VIEWS)
            raise ConfigurationError(f"There is no camera {source}. Take {views}.")
    if any(map(needs_extra, sources.values())):
        require("cv2", EXTRA, PURPOSE)
    # The page's server, which gets the options too, finds the process by it.
    options.camera_process = PrivateAddress(f"{facts.address.name}-cameras", os.urandom(32))
    return ExtraProcess(
        "katana450 cam",
        "The process of the cameras",
        run_cameras,
        CamerasConfig(sources, options.camera_process, facts),
        f"Cameras: {', '.join(sources)}",
    )


def routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes of the cameras' pictures, and list the cameras in the status of pages."""
    address = getattr(context.options, "camera_process", None)
    if address is None:
        return []
    from starlette.routing import Route, WebSocketRoute

    from katana450.extensions.cameras.camera_link import CameraLink, CameraSockets, SharedCameras
    from katana450.extensions.cameras.simulated import send_states
    from katana450.extensions.cameras.sources import BROWSER, SIMULATED
    from katana450.server.api.fields import ROOT

    names = [name for name, _ in context.options.camera]
    shared = {name for name, source in context.options.camera if source == BROWSER}
    cameras = [{"name": name, "shared": name in shared} for name in names]
    context.hub.shown = {**context.hub.shown, ENTRY: cameras}
    drivers_only = context.options.cameras_for == "drivers"
    link = CameraLink(address)
    if any(source.startswith(SIMULATED) for _, source in context.options.camera):
        present = context.hub.present
        states = partial(
            send_states, address, lambda: present().snapshot.state, lambda: link.is_watched
        )
        Thread(target=states, name="states for cameras", daemon=True).start()
    sockets = CameraSockets(link, context.authenticator, names, drivers_only=drivers_only)
    path = f"{ROOT}/cameras/{{name}}"
    sharing = Route(path, SharedCameras(context, address, shared).take, methods=["POST"])
    return [WebSocketRoute(path, sockets.serve), *([sharing] if shared else [])]
