"""Options of ``katana450 log`` and of ``serve``, read without what is heavy."""

from __future__ import annotations

import argparse
import re
import time
from datetime import UTC, datetime
from pathlib import Path

from katana450.settings import Settings

AGO = re.compile(r"(\d+)\s*([smhd])")
SECONDS = {"s": 1, "m": 60, "h": 3600, "d": 86400}


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
    show.add_argument(
        "--since",
        type=_since,
        default="",
        metavar="TIME",
        help="only records since then: 30m, 12h, 7d, or 2026-01-31T12:00, in UTC without an offset",
    )
    show.add_argument(
        "--who", metavar="TEXT", help="only records with this text in name, role, link or address"
    )
    show.add_argument(
        "--kind",
        action="append",
        metavar="KIND",
        help="only records of this kind, such as stop or lease; can be repeated",
    )


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


def _since(text: str) -> str:
    """Return the time in ``text`` as records state it, in UTC."""
    if not text:
        return ""
    if match := AGO.fullmatch(text.strip()):
        ago = int(match[1]) * SECONDS[match[2]]
        return time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(max(time.time() - ago, 0)))
    try:
        since = datetime.fromisoformat(text)
        if since.tzinfo is not None:
            since = since.astimezone(UTC).replace(tzinfo=None)
    except (ValueError, OverflowError):
        raise argparse.ArgumentTypeError(
            f"a time such as 30m, 12h, 7d or 2026-01-31T12:00, not {text!r}"
        ) from None
    return since.isoformat()
