"""Options of ``katana450 record export``, separate from its work: they load nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

FORMATS = {
    "csv": "t,theta1,...,gripper in s, rad and m, as `export html --trajectory` reads it",
    "mcap": "a recording",
    "parquet": "the columns of csv in a Parquet file",
    "rosbag2": "a folder that ROS 2 plays as a bag",
    "lerobot": "a folder that LeRobot reads as a dataset, version 3.0",
    "html": "a page that plays it",
    "mp4": "a film",
}
"""Formats of exports and what they are."""

OUTCOMES = ("success", "failure", "unjudged", "unfinished")
"""Outcomes of episodes, of which a dataset takes the first two by default."""

VIEWS = ("free", "front", "side", "top", "tool")
"""Cameras, as `katana450 render` has them. Without that extension only pictures are missing."""

MIN_SIDE, MAX_SIDE = 16, 4096
"""[px] Range of width and height of pictures."""

DEFAULT_SIZES = {"lerobot": (320, 240), "mp4": (1280, 720)}
"""Width and height of pictures [px] by format."""

DEFAULT_FPS = {"lerobot": 30, "mp4": 25}
"""Frames per second by format."""

USED = {
    "task": ("lerobot",),
    "outcomes": ("lerobot",),
    "views": ("lerobot", "mp4"),
    "size": ("lerobot", "mp4"),
    "fps": ("lerobot", "mp4"),
    "urdf": ("lerobot", "html", "mp4"),
}
"""Formats that use an option; the others refuse it."""

OPTION_NAMES = {"views": "--view"}
"""Names of options that differ from those of their values."""


def add_export_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 record export`` to ``parser``."""
    parser.add_argument(
        "files",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="recordings; for lerobot also folders of episodes",
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
        help="lerobot: camera whose pictures each frame has, several times for several "
        "(default: none); mp4: camera of the film (default: free)",
    )
    sizes = ", ".join(f"{w}x{h} for {name}" for name, (w, h) in DEFAULT_SIZES.items())
    parser.add_argument(
        "--size", type=_size, metavar="WxH", help=f"pixels of pictures (default: {sizes})"
    )
    rates = ", ".join(f"{fps} for {name}" for name, fps in DEFAULT_FPS.items())
    parser.add_argument(
        "--fps", type=int, metavar="N", help=f"frames per second (default: {rates})"
    )
    parser.add_argument(
        "--urdf",
        type=Path,
        metavar="FILE",
        help="for pictures and pages: the recorded robot, if it is not the Katana450 of this "
        "program",
    )


def _outcomes(text: str) -> tuple[str, ...]:
    found = tuple(each.strip() for each in text.split(","))
    if not set(found) <= set(OUTCOMES):
        raise argparse.ArgumentTypeError(
            f"expected some of {', '.join(OUTCOMES)}, separated by commas, not {text!r}"
        )
    return found


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.split("x"))
    except ValueError:
        width = height = 0
    if not (MIN_SIDE <= width <= MAX_SIDE and MIN_SIDE <= height <= MAX_SIDE):
        raise argparse.ArgumentTypeError(
            f"expected two numbers from {MIN_SIDE} to {MAX_SIDE}, such as 320x240, not {text!r}"
        )
    return width, height
