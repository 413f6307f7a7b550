"""Options of ``katana450 log`` and of ``serve``, read without what is heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.settings import Settings


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Add the subcommand show to ``parser``."""
    acts = parser.add_subparsers(dest="act", required=True, metavar="show")
    show = acts.add_parser("show", help="print records, the oldest first")
    show.add_argument(
        "folder",
        type=Path,
        nargs="?",
        metavar="FOLDER",
        help="folder of the log (default: that of the server on --port)",
    )
    show.add_argument("--port", type=int, default=Settings.port, help=argparse.SUPPRESS)


def add_serve_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 serve`` to ``parser``."""
    logged = parser.add_mutually_exclusive_group()
    logged.add_argument(
        "--log",
        type=Path,
        metavar="FOLDER",
        help="folder of the event log (default: one for each port, named at the start)",
    )
    logged.add_argument("--no-log", action="store_true", help="write no event log")
