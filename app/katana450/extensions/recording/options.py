"""Options of ``katana450 record``, apart from their work: they load nothing heavy."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from katana450.cli.option_values import add_server_options, number, size, speed

FORMATS = {
    "csv": "t,theta1,...,gripper in s, rad and m",
    "rosbag2": "a folder that ROS 2 plays as a bag",
    "lerobot": "a folder that LeRobot reads as a dataset, version 3.0",
    "mp4": "a film",
}
"""Formats of exports and what they are."""

OUTCOMES = ("success", "failure", "unjudged", "unfinished")
"""Outcomes of episodes, of which a dataset takes the first two by default."""

VIEWS = ("free", "front", "side", "top", "tool", "wrist")
"""Cameras, as `katana450 render` has them. Without that extension only pictures are missing."""

DEFAULT_SIZES = {"lerobot": (320, 240), "mp4": (1280, 720)}
"""Width and height of pictures [px] by format."""

DEFAULT_FPS = {"lerobot": 30, "mp4": 25}
"""Frames per second by format."""

USED = {
    "task": ("lerobot",),
    "outcomes": ("lerobot",),
    "views": ("lerobot", "mp4"),
    "cameras": ("lerobot",),
    "size": ("lerobot", "mp4"),
    "fps": ("lerobot", "mp4"),
    "urdf": ("lerobot", "mp4"),
}
"""Formats that use an option; the others refuse it."""

OPTION_NAMES = {"views": "--view"}
"""Names of options that differ from those of their values."""


def add_record_options(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands of ``katana450 record`` to ``parser``."""
    acts = parser.add_subparsers(
        dest="act",
        required=True,
        metavar="keep | list | info | verify | again | fork | trim | export",
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
        type=number(0.0, unit="s"),
        default=math.inf,
        metavar="S",
        help="seconds before the end of the recording (default: all)",
    )
    keep.add_argument("--out", type=Path, required=True, metavar="FILE", help="new file")
    listed = acts.add_parser("list", help="list the recordings and episodes in a folder")
    listed.add_argument("folder", type=Path, nargs="?", default=Path(), metavar="FOLDER")
    info = acts.add_parser("info", help="describe a recording")
    verify = acts.add_parser(
        "verify", help="simulate the recorded commands again and compare every tick"
    )
    _add_urdf_option(verify)
    verify.add_argument("--json", action="store_true", help="print the result as JSON")
    again = acts.add_parser("again", help="drive an arm along a recorded motion")
    again.add_argument(
        "--out", type=Path, metavar="FILE", help="write the script instead of running it"
    )
    again.add_argument(
        "--speed", type=speed, default=1.0, help="fraction of the recorded speed (default: 1)"
    )
    add_server_options(again)
    _add_urdf_option(again)
    fork = acts.add_parser("fork", help="let a simulated arm continue from a recorded moment")
    fork.add_argument(
        "--at",
        type=number(0.0, unit="s"),
        required=True,
        metavar="S",
        help="the moment, in seconds after the start of the recording",
    )
    add_server_options(fork)
    for command in (info, verify, again, fork):
        command.add_argument("file", type=Path, metavar="FILE")
    trim = acts.add_parser("trim", help="write a part of a recording, or join several")
    trim.add_argument("files", type=Path, nargs="+", metavar="FILE")
    export = acts.add_parser("export", help="write recordings for other programs")
    _add_export_options(export)
    for command in (trim, export):
        command.add_argument(
            "--out", type=Path, required=True, metavar="FILE", help="new file or folder"
        )
    for command in (trim, export):
        _add_part_options(command)
    _add_part_options(again, episode=True)


def _add_export_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 record export`` to ``parser``."""
    parser.add_argument(
        "files",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="a recording; for lerobot several, and folders of episodes",
    )
    listed = "; ".join(f"{name}: {what}" for name, what in FORMATS.items())
    parser.add_argument(
        "--format",
        choices=tuple(FORMATS),
        default="csv",
        help=f"{listed} (default: %(default)s)",
    )
    parser.add_argument(
        "--task", metavar="TEXT", help="lerobot: task of recordings and episodes without one"
    )
    parser.add_argument(
        "--outcomes",
        type=_outcomes,
        metavar="LIST",
        help="lerobot: outcomes of the episodes to take, of "
        f"{', '.join(OUTCOMES)} (default: success,failure)",
    )
    parser.add_argument(
        "--view",
        dest="views",
        action="append",
        choices=VIEWS,
        help="lerobot: view of the scene that is rendered for each frame, several times for "
        "several (default: none); mp4: view of the film (default: free)",
    )
    parser.add_argument(
        "--cameras",
        type=lambda text: tuple(filter(None, text.split(","))),
        metavar="LIST",
        help="lerobot: recorded cameras whose pictures each frame has, or an empty list (default: "
        "all that every file has)",
    )
    sizes = ", ".join(f"{w}x{h} for {name}" for name, (w, h) in DEFAULT_SIZES.items())
    parser.add_argument(
        "--size", type=size, metavar="WxH", help=f"pixels of pictures (default: {sizes})"
    )
    rates = ", ".join(f"{fps} for {name}" for name, fps in DEFAULT_FPS.items())
    parser.add_argument(
        "--fps", type=int, metavar="N", help=f"frames per second (default: {rates})"
    )
    _add_urdf_option(parser, "for pictures and pages: ")


def _add_part_options(parser: argparse.ArgumentParser, *, episode: bool = False) -> None:
    """Add the options that choose a part of a recording to ``parser``.

    ``episode``: whether the default is None, for the episode of a file that is one.
    """
    whole = "that of the episode, or else of the recording" if episode else "that of the recording"
    parser.add_argument(
        "--from",
        dest="start",
        type=number(0.0, unit="s"),
        default=None if episode else 0.0,
        metavar="S",
        help=f"start of the part, in seconds after the start of the recording (default: {whole})",
    )
    parser.add_argument(
        "--to",
        dest="end",
        type=number(0.0, unit="s"),
        default=None if episode else math.inf,
        metavar="S",
        help=f"end of the part, in seconds after the start of the recording (default: {whole})",
    )


def _add_urdf_option(parser: argparse.ArgumentParser, use: str = "") -> None:
    parser.add_argument(
        "--urdf",
        type=Path,
        metavar="FILE",
        help=f"{use}the recorded robot, if it is not the Katana450 of this program",
    )


def _outcomes(text: str) -> tuple[str, ...]:
    outcomes = tuple(name.strip() for name in text.split(","))
    if not set(outcomes) <= set(OUTCOMES):
        raise argparse.ArgumentTypeError(
            f"expected some of {', '.join(OUTCOMES)}, separated by commas, not {text!r}"
        )
    return outcomes
