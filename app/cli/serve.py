"""``katana450 serve``: open the port, put the parts together, run until told to stop."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from pathlib import Path
from types import FrameType

from app.gateway.gateway import Gateway
from app.settings import Settings
from robot_description import URDF_PATH

AWAKE = 0.2
"""[s] How soon a signal is heeded."""


def serve(
    settings: Settings,
    urdf: Path = URDF_PATH,
    tool: str | None = None,
    workspace: Path | None = None,
) -> int:
    """Run the app until SIGINT or SIGTERM; returns the exit status.

    ``urdf``, ``tool``: the arm, and the link its targets are set for; see ``robot.model.load``.
    ``workspace``: file of a reachability map that can be shown.
    """
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    logging.getLogger("app").setLevel(logging.INFO)
    stopping = threading.Event()

    def stop(_signal: int, _frame: FrameType | None) -> None:
        stopping.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    gateway = Gateway(settings)
    gateway.start()
    scheme = "https" if settings.tls_cert is not None else "http"
    url = settings.public_url or f"{scheme}://{_shown(settings.host)}:{gateway.port}"
    print(f"Open {url} in a browser.", flush=True)
    try:
        # The libraries that read the robot take most of a second: the page loads in the meantime.
        from app.cli.assembly import Assembly

        assembly = Assembly(gateway, settings, urdf, tool, workspace)
        assembly.start()
        if gateway.lines_port is not None:
            print(f"Programs: JSON lines on 127.0.0.1:{gateway.lines_port}.", flush=True)
        print(f"katana450 is ready: {url} (Ctrl-C stops)", flush=True)
        # A signal that another thread is given does not wake this one from its wait.
        while not stopping.wait(AWAKE):
            pass
        gateway.stop()
        assembly.stop()
    finally:
        gateway.stop()
    return 0


def _shown(host: str) -> str:
    """The address a person on this machine can open."""
    if host in ("0.0.0.0", "::", ""):
        return "127.0.0.1"
    return f"[{host}]" if ":" in host else host
