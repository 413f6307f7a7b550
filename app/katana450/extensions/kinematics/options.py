"""Options of ``katana450 fk`` and ``katana450 ik``; reading them loads nothing heavy."""

from __future__ import annotations

import argparse

from katana450.cli.option_values import add_arm_options

FRAMES = ("shoulder", "base")


def add_fk_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``fk`` to ``parser``."""
    _add_frame(parser)
    add_arm_options(parser)


def add_ik_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``ik`` to ``parser``."""
    _add_frame(parser)
    parser.add_argument(
        "--nearest",
        action="store_true",
        help='add the nearest posture inside the limits, to "q" in the line if several are equally '
        "good, with its losses and the limits that bind",
    )
    add_arm_options(parser)


def _add_frame(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--frame",
        choices=FRAMES,
        default=FRAMES[0],
        help="coordinates of T: the paper's frame {S} at the shoulder, or the base on the "
        "table (default: %(default)s)",
    )
