"""Options of ``katana450 score``, separate from its work: reading them must load nothing heavy."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from katana450.extensions.recording.record_options import add_part_options


def add_score_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 score`` to ``parser``."""
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="recordings")
    add_part_options(parser, episode=True)
    parser.add_argument(
        "--target",
        action="append",
        default=[],
        type=_target,
        metavar="OBJECT=X,Y[,Z]",
        help="place at which an object should stand at the end, in mm in the base frame",
    )
    parser.add_argument(
        "--like",
        type=Path,
        metavar="FILE",
        help="a recording at whose end the objects stand where they should",
    )
    parser.add_argument(
        "--sort",
        default="duration_s",
        metavar="MEASURE",
        help="measure by which several recordings are sorted (default: %(default)s)",
    )
    parser.add_argument("--json", action="store_true", help="print the measures as JSON")
    parser.add_argument(
        "--urdf",
        type=Path,
        metavar="FILE",
        help="the recorded robot, if it is not the Katana450 of this program",
    )


def _target(text: str) -> tuple[str, tuple[float, float, float]]:
    name, _, place = text.partition("=")
    try:
        numbers = [1e-3 * float(each) for each in place.split(",")]
    except ValueError:
        numbers = []
    if not name or len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
        raise argparse.ArgumentTypeError(f"expected OBJECT=X,Y or OBJECT=X,Y,Z, not {text!r}")
    x, y, z = (*numbers, math.nan)[:3]
    return name, (x, y, z)
