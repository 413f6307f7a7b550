"""Values and options that several commands have."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path

from katana450.resources import URDF_PATH

SERVER = "http://127.0.0.1:8080"
"""Address of a server that was started without options."""

MAX_PORT = 65535


def number(lowest: float, highest: float = math.inf, unit: str = "") -> Callable[[str], float]:
    """Return the type of an option for a number from ``lowest`` to ``highest`` in ``unit``."""
    bounds = f"from {lowest:g} {f'to {highest:g} ' if highest < math.inf else ''}{unit}".rstrip()

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not lowest <= value <= highest:
            raise argparse.ArgumentTypeError(f"a number {bounds} is expected, not {text!r}")
        return value

    return read


speed = number(0.01, 1.0)
"""Type of an option for a fraction of a program's own speed, from `MIN_SPEED` of the session."""


def port(text: str) -> int:
    """Return the TCP port in ``text``; 0 for any free one. Raises ArgumentTypeError."""
    if not text.isdecimal() or len(text) > 5 or int(text) > MAX_PORT:
        raise argparse.ArgumentTypeError(f"a port is a number from 0 to {MAX_PORT}, not {text!r}")
    return int(text)


def size(text: str) -> tuple[int, int]:
    """Return width and height of a picture [px] in WxH. Raises ArgumentTypeError."""
    try:
        width, height = (int(part) for part in text.split("x"))
    except ValueError:
        width = height = 0
    if not (16 <= width <= 4096 and 16 <= height <= 4096):
        raise argparse.ArgumentTypeError(
            f"two numbers from 16 to 4096 are expected, such as 1280x720, not {text!r}"
        )
    return width, height


def add_server_options(parser: argparse.ArgumentParser, remark: str = "") -> None:
    """Add ``--url`` and ``--token`` of the server that a command drives. ``remark``: more help."""
    parser.add_argument(
        "--url", default=SERVER, help=f"address of the server (default: %(default)s){remark}"
    )
    parser.add_argument(
        "--token", default="", help="token of an access link, if the server needs one"
    )


def add_arm_options(
    parser: argparse.ArgumentParser, *, names: bool = True, tool: bool = True
) -> None:
    """Add ``--urdf`` to ``parser``, with ``names`` also ``--arm``, and with ``tool`` ``--tool``."""
    if names:
        parser.add_argument(
            "--arm",
            type=_name,
            metavar="NAME",
            help="the robot: one of the gallery, which `katana450 arms` lists (default: katana450)",
        )
    parser.add_argument(
        "--urdf",
        type=Path,
        default=URDF_PATH,
        metavar="FILE",
        help="another robot; `serve` drives the tool of an arm, and any other tree joint by joint "
        "(default: the Katana450)",
    )
    parser.add_argument(
        "--xacro-arg",
        type=_assignment,
        action="append",
        metavar="NAME:=VALUE",
        help="value of an argument of the xacro file that --urdf names; can be repeated",
    )
    if tool:
        parser.add_argument(
            "--tool", metavar="LINK", help="link to which targets refer (default: the last one)"
        )


def _assignment(text: str) -> tuple[str, str]:
    """Return name and value in NAME:=VALUE. Raises ArgumentTypeError for any other text."""
    name, sign, value = text.partition(":=")
    if not (name and sign):
        raise argparse.ArgumentTypeError(f"NAME:=VALUE is expected, such as model:=small: {text!r}")
    return name, value


def _name(text: str) -> str:
    """Return the name of a robot. Raises ArgumentTypeError for an address or a file."""
    if any(sign in text for sign in ".:/\\"):
        raise argparse.ArgumentTypeError(
            f"{text!r} is an address or a file, not the name of a robot: give the address of a "
            "real arm to `serve` by --device, and a file by --urdf"
        )
    return text
