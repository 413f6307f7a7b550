"""Options of ``katana450 export``, and the choice of the format."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.cli.option_values import add_arm_options
from katana450.errors import InputError
from katana450.extensions.export.formats import FORMATS, named


def add_export_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 export`` to ``parser``."""
    parser.add_argument("format", choices=tuple(FORMATS), help=_listed())
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="directory for the files, or the path of the html file",
    )
    parser.add_argument(
        "--plain",
        action="store_true",
        help="vrml and x3d: shapes without a Switch, for three.js and other programs that skip it",
    )
    parser.add_argument(
        "--no-objects",
        dest="objects",
        action="store_false",
        help="vrml and x3d: leave out the cup and the basin of a new server",
    )
    add_shown_options(parser, "html: ", "all at zero")
    add_arm_options(parser, tool=False)


def add_shown_options(
    parser: argparse.ArgumentParser, formats: str = "", pose: str = "Home"
) -> None:
    """Add the options of what is shown to ``parser``: a pose, a table of a motion, or a run.

    ``formats``: those that show a motion. ``pose``: the default of the pose.
    """
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument(
        "--pose",
        type=joint_values,
        default=(),
        metavar="Q",
        help="comma-separated values of the driven joints in rad or m, gripper last, such as "
        f"--pose=0,-1.2,1.4,0.1,0,0.2 (default: {pose})",
    )
    shown.add_argument(
        "--trajectory",
        type=Path,
        metavar="FILE",
        help=f"{formats}motion, a .csv with the columns t,theta1,...,theta5,gripper, or trace.csv "
        "of a report",
    )
    shown.add_argument(
        "--run",
        metavar="SCRIPT",
        help=f"{formats}run that is shown: circle, pour or the file of a script",
    )


def export_format(options: argparse.Namespace) -> int:
    """Execute ``katana450 export``; return the exit status."""
    row = FORMATS[options.format]
    if not row.scene and (options.plain or not options.objects):
        names = " or ".join(named(lambda listed: listed.scene))
        raise InputError(f"{options.format} has no Switch and no objects. Use {names}.")
    if row.moves:
        from katana450.extensions.export.page import write_page

        return write_page(options)
    from katana450.extensions.export.export import export

    return export(options)


def _listed() -> str:
    return "; ".join(f"{name}: {row.help}" for name, row in FORMATS.items())


def joint_values(text: str) -> tuple[float, ...]:
    """Return the numbers [rad, m] of a comma-separated list. Raises ArgumentTypeError."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"expected comma-separated numbers, not {text!r}"
        ) from None
