"""Options of ``katana450 access``, read without what its work loads."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from katana450.arm.control.lease import Role

DEFAULT_FILE = Path("access.json")
DEFAULT_DURATION = "12h"
SECONDS = {"m": 60, "h": 3600, "d": 86400}
MAX_DAYS = 366


def add_access_options(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands give, list and revoke to ``parser``."""
    acts = parser.add_subparsers(dest="act", required=True, metavar="give | list | revoke")
    give = acts.add_parser("give", help="print a link for one person")
    give.add_argument("--name", required=True, help="name that other people see")
    give.add_argument(
        "--role",
        choices=[role.value for role in Role],
        default=Role.OPERATOR.value,
        help="viewer: watch and stop; operator: drive when nobody else does; admin: also take the "
        "arm from others (default: %(default)s)",
    )
    give.add_argument(
        "--for",
        dest="duration",
        type=_duration,
        default=DEFAULT_DURATION,
        metavar="TIME",
        help="how long it is valid, such as 30m, 12h or 7d (default: %(default)s)",
    )
    give.add_argument(
        "--url",
        default="http://127.0.0.1:8080",
        help="address of the server (default: %(default)s)",
    )
    acts.add_parser("list", help="list the links and their holders")
    revoke = acts.add_parser("revoke", help="revoke a link and disconnect its holder")
    revoke.add_argument("number", help="number of the link in `list`")
    for act in acts.choices.values():
        act.add_argument(
            "--file",
            type=Path,
            default=DEFAULT_FILE,
            help="file of the links; secret, never in version control (default: %(default)s)",
        )


def _duration(text: str) -> float:
    match = re.fullmatch(r"(\d{1,4})([mhd])", text)
    seconds = int(match[1]) * SECONDS[match[2]] if match else 0
    if not 0 < seconds <= MAX_DAYS * SECONDS["d"]:
        raise argparse.ArgumentTypeError(
            f"a time is a number and m, h or d, at most {MAX_DAYS}d, not {text!r}"
        )
    return float(seconds)
