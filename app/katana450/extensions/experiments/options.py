"""Options of ``katana450 run`` and ``katana450 demo``."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.cli.option_values import add_server_options, speed
from katana450.resources import URDF_PATH

DEMOS = ("circle", "pour")
"""Names of the scripts of the library that are the experiments of the paper."""


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 run`` to ``parser``."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a script; see docs/programs.md")
    _add_common(parser)


def add_demo_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 demo`` to ``parser``."""
    parser.add_argument(
        "demo",
        choices=DEMOS,
        help="the circle of the paper, or a cup of water, carried to a basin and emptied there",
    )
    _add_common(parser)


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--headless", action="store_true", help="simulate, without server and browser"
    )
    parser.add_argument("--dry-run", action="store_true", help="only plan, and print the tasks")
    parser.add_argument(
        "--report", type=Path, metavar="DIR", help="write figures, measures and a table of the run"
    )
    parser.add_argument(
        "--speed", type=speed, default=1.0, help="fraction of its own speed (default: 1)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of the paths round obstacles (default: 0)"
    )
    add_server_options(parser, "; if none answers on this machine, one is started")
    parser.add_argument(
        "--urdf", type=Path, default=URDF_PATH, metavar="FILE", help="another arm, for --headless"
    )
    parser.add_argument(
        "--scene",
        type=Path,
        metavar="FILE",
        help="the scene in which it begins: a scene.yaml with its meshes beside it, or a .zip of "
        "both; for --headless, --dry-run, and a server that is started",
    )
