"""What may be chosen at start-up, read once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

READY_POSTURE_DEG = (0.0, -68.0, 85.0, 8.0, 0.0)
"""Elbow up, tool 25 degrees down in front of the arm, the wrist midway between folded and
stretched: room to drag and turn the tool in every direction."""


@dataclass(frozen=True)
class Settings:
    """Of one server.

    Attributes:
        host: address to listen on; only this machine unless told otherwise.
        port: TCP port.
        rate: control ticks a second [Hz].
        frame_rate: most view updates a second [Hz].
        ready: posture the arm starts in and Home returns to [rad].
        silence: time without a heartbeat of whoever drives that stops an arm that moves [s].
        access: file of the links by which people come in; without it nobody is asked.
        insecure: other machines may come in unasked.
        tls_cert, tls_key: files of a certificate and its key, for https.
        public_url: what people type when a reverse proxy stands in front.
        bare: whether the arm is without its gripper.
        lines: TCP port of this machine for programs that speak JSON lines; None without.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    rate: float = 100.0
    frame_rate: float = 60.0
    ready: tuple[float, ...] = tuple(math.radians(angle) for angle in READY_POSTURE_DEG)
    silence: float = 0.25
    access: Path | None = None
    insecure: bool = False
    tls_cert: Path | None = None
    tls_key: Path | None = None
    public_url: str | None = None
    lines: int | None = None
    bare: bool = False
