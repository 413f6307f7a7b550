"""Options of ``katana450 people``, separate from its work: reading them must load nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

TOKEN_VARIABLE = "KATANA450_TOKEN"
"""Environment variable with the token of an admin's link. Other users cannot read it, unlike a
command line."""


def add_people_options(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands list, kick and let-in to ``parser``."""
    acts = parser.add_subparsers(dest="act", required=True, metavar="list | kick | let-in")
    acts.add_parser("list", help="list everybody who is connected or kept out")
    kick = acts.add_parser("kick", help="close all connections of a person")
    kick.add_argument(
        "--seconds",
        type=float,
        default=60.0,
        help="time after which the person may come back (default: %(default)g)",
    )
    kick.add_argument("--revoke", action="store_true", help="revoke the link for good")
    let_in = acts.add_parser("let-in", help="let a person in again before the time")
    for act in (kick, let_in):
        act.add_argument("person", type=int, help="number of the person in `list`")
    for act in acts.choices.values():
        act.add_argument(
            "--url", default="http://127.0.0.1:8080", help="address of the server (%(default)s)"
        )
        act.add_argument(
            "--token-file",
            type=Path,
            metavar="FILE",
            help=f"file with the link of an admin, or its token; else ${TOKEN_VARIABLE}",
        )
