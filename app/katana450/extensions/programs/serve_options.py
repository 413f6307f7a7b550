"""Options of ``katana450 serve`` for programs."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

from katana450.cli.option_values import number
from katana450.cli.serve_options import MIN_SILENCE

OWNER_SILENCE, LONGEST_OWNER_SILENCE = 1.0, 10.0
"""[s] Default and longest heartbeat timeout of a program's owner, after which the program ends."""


def add_serve_options(parser: ArgumentParser) -> None:
    """Add the options for programs to ``katana450 serve``."""
    parser.add_argument(
        "--owner-silence",
        type=number(MIN_SILENCE, LONGEST_OWNER_SILENCE, "s"),
        default=OWNER_SILENCE,
        metavar="SECONDS",
        help="heartbeat timeout of a program's owner, after which the program ends "
        f"({MIN_SILENCE:g} to {LONGEST_OWNER_SILENCE:g}, default: %(default)s)",
    )
    parser.add_argument(
        "--programs",
        type=Path,
        metavar="DIR",
        help="folder of scripts for the page, which saves taught scripts there too",
    )
