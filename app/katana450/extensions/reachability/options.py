"""Options of ``katana450 workspace`` and of ``serve``, and the map that they choose."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from katana450.cli.arm_options import add_arm_options

if TYPE_CHECKING:
    from katana450.server.view.layer import ViewLayer


def add_workspace_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 workspace`` to ``parser``; lengths are in mm."""
    parser.add_argument(
        "--table",
        type=float,
        default=0.0,
        metavar="HEIGHT",
        help="height of the table above the foot of the control box, mm (default: %(default)g)",
    )
    parser.add_argument(
        "--voxel",
        type=float,
        metavar="MM",
        help="edge of a voxel, mm (default: what suits the arm, 20 for the Katana450)",
    )
    parser.add_argument("--out", type=Path, metavar="FILE.npz", help="file for the map")
    add_arm_options(parser)


def add_serve_options(parser: argparse.ArgumentParser) -> None:
    """Add the option for a map to ``katana450 serve``."""
    parser.add_argument(
        "--workspace",
        type=Path,
        metavar="FILE.npz",
        help="map from `katana450 workspace --out`, shown in the scene",
    )


def chosen_map(options: argparse.Namespace) -> ViewLayer | None:
    """Return the layer of the map that ``options`` name; None without one."""
    if options.workspace is None:
        return None
    from katana450.extensions.reachability.view import ReachabilityLayer

    return ReachabilityLayer(options.workspace)
