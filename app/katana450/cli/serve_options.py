"""Options of ``katana450 serve``, separate from its work: reading them must load nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.cli.option_values import add_arm_options, number, port
from katana450.extension import provided
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
        "--port", type=port, default=Settings.port, help="TCP port (default: %(default)s)"
    )
    parser.add_argument(
        "--silence",
        type=number(MIN_SILENCE, MAX_SILENCE, "s"),
        default=Settings.silence,
        metavar="SECONDS",
        help="heartbeat timeout of the driver, after which a moving arm brakes; the page of the "
        f"driver sends ten a second ({MIN_SILENCE:g} to {MAX_SILENCE:g}, default: %(default)s)",
    )
    parser.add_argument(
        "--strict-silence",
        action="store_true",
        help="after the heartbeat timeout, stop a simulated arm like a real one until the stop is "
        "cleared; without this option it pauses, and the next command moves it",
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
        "--bare", action="store_true", help="the arm without its gripper, as in the paper's circle"
    )
    parser.add_argument(
        "--lines",
        type=port,
        metavar="PORT",
        help="a TCP port of this machine for programs that send JSON lines",
    )
    parser.add_argument(
        "--stop-port",
        type=port,
        metavar="PORT",
        help="TCP port that serves STOP alone, from a process of its own (default: the port after "
        "--port, or a free one)",
    )
    logged = parser.add_mutually_exclusive_group()
    logged.add_argument(
        "--log",
        type=Path,
        metavar="FOLDER",
        help="folder of the event log (default: one for each port, named at the start)",
    )
    logged.add_argument("--no-log", action="store_true", help="write no event log")
    parser.add_argument("--no-browser", action="store_true", help="do not open the page by itself")
    for add_options in provided("serve_options"):
        add_options(parser)
    add_arm_options(parser)
