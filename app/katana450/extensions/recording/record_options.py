"""Options of ``katana450 record``, separate from its work: reading them must load nothing heavy."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from katana450.extensions.recording.datasets.export_options import add_export_options

URL = "http://127.0.0.1:8080"
"""Default address of the server."""

MIN_SPEED = 0.01
"""[1] Smallest fraction of its speed at which a program runs."""


def add_record_options(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands of ``katana450 record`` to ``parser``."""
    acts = parser.add_subparsers(
        dest="act",
        required=True,
        metavar="keep | list | info | recover | verify | again | trim | export | episodes",
    )
    keep = acts.add_parser(
        "keep", help="keep what a server has just recorded, whether it still runs or not"
    )
    keep.add_argument(
        "folder",
        type=Path,
        metavar="FOLDER",
        help="folder of the last ten minutes, which the server names at its start",
    )
    keep.add_argument(
        "--last",
        type=_seconds,
        default=math.inf,
        metavar="S",
        help="seconds before the end of the recording (default: all)",
    )
    for name, end in (("--since", "begin"), ("--until", "end")):
        keep.add_argument(
            name,
            type=_seconds,
            metavar="S",
            help=f"{end} of the part, in seconds since 1970 (UTC)",
        )
    keep.add_argument("--out", type=Path, required=True, metavar="FILE", help="new file")
    listed = acts.add_parser("list", help="list the recordings in a folder")
    listed.add_argument("folder", type=Path, nargs="?", default=Path(), metavar="FOLDER")
    info = acts.add_parser("info", help="describe a recording")
    info.add_argument("file", type=Path, metavar="FILE")
    recover = acts.add_parser("recover", help="repair a recording after a crash")
    recover.add_argument("file", type=Path, metavar="FILE")
    recover.add_argument(
        "--out", type=Path, metavar="FILE", help="new file (default: replace the broken one)"
    )
    verify = acts.add_parser(
        "verify", help="simulate the recorded commands again and compare every tick"
    )
    verify.add_argument("file", type=Path, metavar="FILE")
    verify.add_argument(
        "--urdf",
        type=Path,
        metavar="FILE",
        help="the recorded robot, if it is not the Katana450 of this program",
    )
    verify.add_argument("--json", action="store_true", help="print the result as JSON")
    again = acts.add_parser("again", help="drive an arm along a recorded motion, or simulate it")
    again.add_argument("file", type=Path, metavar="FILE")
    again.add_argument(
        "--headless", action="store_true", help="simulate it in the recorded scene, without server"
    )
    again.add_argument(
        "--out", type=Path, metavar="FILE", help="write the script instead of running it"
    )
    again.add_argument(
        "--speed", type=_speed, default=1.0, help="fraction of the recorded speed (default: 1)"
    )
    again.add_argument("--url", default=URL, help="address of the server (default: %(default)s)")
    again.add_argument(
        "--token", default="", help="token of an access link, if the server needs one"
    )
    again.add_argument(
        "--unattended",
        action="store_true",
        help="let it run on when this command is ended or loses its connection",
    )
    again.add_argument(
        "--urdf",
        type=Path,
        metavar="FILE",
        help="the recorded robot, if it is not the Katana450 of this program",
    )
    trim = acts.add_parser("trim", help="write a part of a recording, or join several")
    trim.add_argument("files", type=Path, nargs="+", metavar="FILE")
    _add_episode_options(
        acts.add_parser("episodes", help="list and recover the episodes in a folder")
    )
    export = acts.add_parser("export", help="write recordings for other programs")
    add_export_options(export)
    for each in (trim, export):
        each.add_argument(
            "--out", type=Path, required=True, metavar="FILE", help="new file or folder"
        )
    for each in (trim, export):
        add_part_options(each)
    add_part_options(again, episode=True)


def _add_episode_options(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands of ``katana450 record episodes`` to ``parser``."""
    acts = parser.add_subparsers(dest="episode_act", required=True, metavar="list | recover")
    acts.add_parser("list", help="list the episodes in a folder")
    acts.add_parser(
        "recover", help="finish the episode that ran when a server ended, without that server"
    )
    for act in acts.choices.values():
        act.add_argument("folder", type=Path, metavar="FOLDER")


def add_part_options(parser: argparse.ArgumentParser, *, episode: bool = False) -> None:
    """Add the options that choose a part of a recording to ``parser``.

    ``episode``: whether the default is None, for the episode of a file that is one.
    """
    whole = "that of the episode, or else of the recording" if episode else "that of the recording"
    parser.add_argument(
        "--from",
        dest="start",
        type=_seconds,
        default=None if episode else 0.0,
        metavar="S",
        help=f"start of the part, in seconds after the start of the recording (default: {whole})",
    )
    parser.add_argument(
        "--to",
        dest="end",
        type=_seconds,
        default=None if episode else math.inf,
        metavar="S",
        help=f"end of the part, in seconds after the start of the recording (default: {whole})",
    )


def _speed(text: str) -> float:
    value = _seconds(text)
    if not MIN_SPEED <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"a fraction from {MIN_SPEED:g} to 1, not {text!r}")
    return value


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"a number of seconds from 0, not {text!r}")
    return value
