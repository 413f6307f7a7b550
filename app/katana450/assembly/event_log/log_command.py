"""``katana450 log`` shows the event log of a server. Its options are read without what it loads."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from katana450.assembly.event_log.records import Record
from katana450.assembly.log_output import printable
from katana450.errors import InputError
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


def log(options: argparse.Namespace) -> int:
    """Run ``katana450 log`` and return the exit status: 1 if a line is not a record."""
    from katana450.assembly.event_log.disk_log import default_folder
    from katana450.assembly.event_log.log_files import lines_of

    folder = options.folder or default_folder(options.port)
    if options.folder is None and not folder.is_dir() and folder.parent.is_dir():
        names = ", ".join(str(path) for path in sorted(folder.parent.iterdir()))
        raise InputError(f"There is no event log in {folder}. Name one of: {names or 'none'}.")
    status = 0
    for line in lines_of(folder):
        if line.record is None:
            print(f"{line.place}: this is not a record.", file=sys.stderr)
            status = 1
        else:
            print(_shown(line.record))
    return status


def _shown(record: Record) -> str:
    """Return ``record`` as one line without control characters."""
    who, what = record.get("who"), record.get("what")
    name, about = "", ""
    if isinstance(who, dict):
        name = str(who.get("name", ""))
        rest = [str(value) for key, value in who.items() if key != "name"]
        about = f" ({', '.join(rest)})" if rest else ""
    content = _values(what) if isinstance(what, dict) else json.dumps(what) if what else ""
    grounds = f"[{record['grounds']}]" if "grounds" in record else ""
    outcome = ": ".join(str(record[key]) for key in ("outcome", "why") if key in record)
    parts = (
        _text(record, "time"),
        f"{name}{about}",
        _text(record, "kind"),
        content,
        grounds,
        outcome,
    )
    return printable("  ".join(part for part in parts if part))


def _values(what: Record) -> str:
    return " ".join(
        f"{key}={value if isinstance(value, str) else json.dumps(value)}"
        for key, value in what.items()
    )


def _text(record: Record, key: str) -> str:
    return str(record.get(key, ""))
