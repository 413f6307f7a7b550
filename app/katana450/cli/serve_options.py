"""Options of ``katana450 serve``, separate from its work: reading them must load nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.cli.arm_options import add_arm_options
from katana450.extension import serve_extensions
from katana450.settings import Settings

MIN_SILENCE, MAX_SILENCE = 0.2, 2.0
"""[s] Heartbeats are 0.1 s apart, and after 3 s the driver loses the lease."""


def add_serve_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``serve`` to ``parser``."""
    parser.add_argument(
        "--host",
        default=Settings.host,
        help="address to listen on; one that other machines can reach needs --access "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--port", type=_port, default=Settings.port, help="TCP port (default: %(default)s)"
    )
    parser.add_argument(
        "--silence",
        type=_silence,
        default=Settings.silence,
        metavar="SECONDS",
        help="heartbeat timeout of the driver, after which a moving arm is stopped; the page sends "
        f"ten a second ({MIN_SILENCE:g} to {MAX_SILENCE:g}, default: %(default)s)",
    )
    parser.add_argument(
        "--access",
        type=Path,
        metavar="FILE",
        help="admit only people with a link that `katana450 access give` wrote to this file",
    )
    parser.add_argument(
        "--insecure",
        action="store_true",
        help="admit other machines without a link: everybody there can drive the arm",
    )
    parser.add_argument("--tls-cert", type=Path, metavar="FILE", help="certificate, for https")
    parser.add_argument("--tls-key", type=Path, metavar="FILE", help="its private key")
    parser.add_argument(
        "--public-url",
        metavar="URL",
        help="address of the reverse proxy in front of the server, e.g. https://arm.example.org",
    )
    parser.add_argument(
        "--bare",
        action="store_true",
        help="the arm without its gripper, as in the paper's circle",
    )
    parser.add_argument(
        "--go-on-release",
        action="store_true",
        help="at the end of a drag that a gap held up, move along the detour that leads to its "
        "target, without waiting for Go",
    )
    parser.add_argument(
        "--lines",
        type=_port,
        metavar="PORT",
        help="a TCP port of this machine for programs that send JSON lines",
    )
    for part in serve_extensions():
        if part.add_options is not None:
            part.add_options(parser)
    add_arm_options(parser)


def _silence(text: str) -> float:
    return heartbeat_timeout(text, MAX_SILENCE)


def heartbeat_timeout(text: str, longest: float) -> float:
    """Return the number of seconds in ``text``, from MIN_SILENCE to ``longest``.

    Raises ArgumentTypeError for any other text.
    """
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not MIN_SILENCE <= seconds <= longest:
        raise argparse.ArgumentTypeError(
            f"a number of seconds from {MIN_SILENCE:g} to {longest:g}, not {text!r}"
        )
    return seconds


def _port(text: str) -> int:
    try:
        port = int(text)
    except ValueError:
        port = -1
    if not 0 <= port <= 65535:
        raise argparse.ArgumentTypeError(f"a port is a number from 0 to 65535, not {text!r}")
    return port
