"""Settings of the server, read once at the start."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

READY_POSTURE_DEG = (0.0, -68.0, 85.0, 8.0, 0.0)
"""[deg] Elbow up, tool pitched 25 degrees down in front of the arm, wrist midway between folded
and stretched. It leaves room to drag and turn the tool in every direction."""


FIXED = frozenset({"rate", "ready", "sample_delay"})
"""Names of the settings that no option of ``serve`` sets."""


@dataclass(frozen=True)
class Settings:
    """Settings of one server.

    Attributes:
        host: address to listen on; by default only this machine.
        port: TCP port.
        rate: control ticks per second [Hz].
        ready: posture in which the arm starts and to which Home returns [rad].
        silence: heartbeat timeout of the driver, after which a moving arm brakes [s].
        sample_delay: delay above the least of its connection, from which a sample of a jog, drag or
            stream is not executed [s].
        strict_silence: whether a simulated arm reacts to silence as a real one: with a latched stop
            in place of a pause.
        access: file of the access links; without it nobody has to sign in.
        insecure: whether other machines may connect without signing in.
        tls_cert, tls_key: files of a certificate and its key, for https.
        public_url: URL that people enter when the server is behind a reverse proxy.
        lines: TCP port of this machine for programs that send JSON lines; None for no such port.
        bare: whether the arm has no gripper.
        stop_port: TCP port that serves STOP alone; None for the port after ``port``, or a free one.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    rate: float = 100.0
    ready: tuple[float, ...] = tuple(math.radians(angle) for angle in READY_POSTURE_DEG)
    silence: float = 0.25
    sample_delay: float = 0.15
    strict_silence: bool = False
    access: Path | None = None
    insecure: bool = False
    tls_cert: Path | None = None
    tls_key: Path | None = None
    public_url: str | None = None
    lines: int | None = None
    bare: bool = False
    stop_port: int | None = None
