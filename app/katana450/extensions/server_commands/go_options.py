"""Options of ``katana450 go``, separate from its work: reading them must load nothing heavy."""

from __future__ import annotations

import argparse
import math


def add_go_options(parser: argparse.ArgumentParser) -> None:
    """Add the place of the tool, and the address and token of the server, to ``parser``."""
    parser.add_argument(
        "place", type=_place, metavar="X,Y,Z", help="mm, in the frame {S} at the shoulder"
    )
    parser.add_argument(
        "--url",
        default="http://127.0.0.1:8080",
        help="address of the server (default: %(default)s)",
    )
    parser.add_argument(
        "--token", default="", help="token of an access link, if the server needs one"
    )


def _place(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise argparse.ArgumentTypeError(f"expected three numbers X,Y,Z in mm, not {text!r}")
    return x, y, z
