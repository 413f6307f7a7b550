"""The page, opened in the browser of the person who starts the server."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from threading import Thread

from katana450.assembly.log_output import say

SCREENS = {"DISPLAY", "WAYLAND_DISPLAY", "WSL_DISTRO_NAME"}
"""Variables of which a Linux that can show a browser has one."""


def show_page(url: str, *ports: int) -> None:
    """Open ``url`` in a thread, or say how to open it from elsewhere through a tunnel of ``ports``.

    A server that no person started, and one in a container, opens nothing unless BROWSER is set.
    """
    remote = "SSH_CONNECTION" in os.environ
    if not os.environ.get("BROWSER"):
        in_container = "container" in os.environ or Path("/.dockerenv").exists()
        if in_container or not sys.stdout.isatty():
            return
        remote |= sys.platform == "linux" and not SCREENS & os.environ.keys()
    if not remote:
        Thread(target=_open, args=(url,), daemon=True).start()
    elif sys.stdout.isatty():
        tunnel = " ".join(f"-L {port}:127.0.0.1:{port}" for port in ports)
        say(f"No display here: run `ssh {tunnel} HOST` where there is one, and open {url} there.")


def _open(url: str) -> None:
    if not webbrowser.open(url):
        say(f"No browser could be started. Open {url} in one yourself.")
