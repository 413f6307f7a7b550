"""The configuration of a front end."""

from __future__ import annotations

import socket
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

from katana450.arm.runtime.arm_listener import ArmAddress
from katana450.settings import Settings


@dataclass(frozen=True)
class FrontendConfig:
    """Configuration of a front end, used each time it is started.

    Attributes:
        settings: of the server.
        urdf, tool: see ``robot.loader.load``.
        listening: the socket for browsers.
        lines: the socket for programs that send JSON lines, if any.
        options: options of the extensions; None if no extension takes part.
        address: address of the arm's process.
        folder: private folder with the meshes of scene objects.
    """

    settings: Settings
    urdf: Path
    tool: str | None
    listening: socket.socket
    lines: socket.socket | None
    options: Namespace | None
    address: ArmAddress
    folder: Path
