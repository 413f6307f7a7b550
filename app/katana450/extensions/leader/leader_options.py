"""Options of ``katana450 leader``, separate from its work: reading them must load nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.cli.option_values import add_server_options


def add_leader_options(parser: argparse.ArgumentParser) -> None:
    """Add port, calibration, and the address and token of the server, to ``parser``."""
    parser.add_argument(
        "port", help="serial port of the leader, such as /dev/ttyUSB0 or COM3, or tcp://HOST:PORT"
    )
    parser.add_argument(
        "--calibration",
        type=Path,
        required=True,
        metavar="FILE",
        help="calibration of the leader, a JSON file of LeRobot",
    )
    add_server_options(parser)
