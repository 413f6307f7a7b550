"""Options of ``katana450 record episodes``; reading them must load nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_episode_options(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands of ``katana450 record episodes`` to ``parser``."""
    acts = parser.add_subparsers(dest="episode_act", required=True, metavar="list | recover")
    acts.add_parser("list", help="list the episodes in a folder")
    acts.add_parser(
        "recover", help="finish the episode that ran when a server ended, without that server"
    )
    for act in acts.choices.values():
        act.add_argument("folder", type=Path, metavar="FOLDER")
