"""``katana450 access``, which gives people links. Its options are read without what it loads."""

from __future__ import annotations

import argparse
import re
import time
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


def access(options: argparse.Namespace) -> int:
    """Run ``katana450 access`` and return the exit status."""
    from katana450.server.web.access_links import AccessFile
    from katana450.server.web.authenticator import public_origin

    now = time.time()
    if options.act == "give":
        file = AccessFile.create(options.file)
        origin = public_origin(options.url)
        token = file.give(options.name, Role(options.role), now + options.duration)
        # Browsers send the part after the # to no server, so no log contains it.
        print(f"{origin}/#{token}")
        return 0
    file = AccessFile.open(options.file)
    if options.act == "revoke":
        grant = file.revoke(options.number)
        print(f"The link of {grant.name} is revoked.")
        return 0
    for number, grant in file.grants.items():
        until = time.strftime("%Y-%m-%d %H:%M", time.localtime(grant.expires))
        state = f"until {until}" if now < grant.expires else f"expired {until}"
        print(f"{number}  {grant.role.value:8}  {state:24}  {grant.name}")
    return 0
