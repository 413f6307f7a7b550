"""Options of the commands that select another arm."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.resources import URDF_PATH


def add_arm_options(
    parser: argparse.ArgumentParser, *, names: bool = True, tool: bool = True
) -> None:
    """Add ``--urdf`` to ``parser``, with ``names`` also ``--arm``, and with ``tool`` ``--tool``."""
    if names:
        parser.add_argument(
            "--arm",
            type=_name,
            metavar="NAME",
            help="a robot of the gallery; `katana450 arms` lists them",
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
    if "." in text or ":" in text:
        raise argparse.ArgumentTypeError(
            f"{text!r} is an address or a file; this command takes the name of a robot, and a file "
            "by --urdf"
        )
    return text
