"""The options of ``katana450 workspace``, apart from its work: reading them must load nothing."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_workspace_options(parser: argparse.ArgumentParser) -> None:
    """Put them into `parser`; lengths are in mm, as a person measures them."""
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
        default=20.0,
        metavar="MM",
        help="edge of a voxel, mm (default: %(default)g)",
    )
    parser.add_argument(
        "--pitches",
        type=int,
        default=36,
        metavar="N",
        help="pitches of the tool tried in each voxel, all round (default: %(default)s)",
    )
    parser.add_argument(
        "--rolls",
        type=int,
        default=24,
        metavar="N",
        help="rolls of the tool tried for each pitch, all round (default: %(default)s)",
    )
    parser.add_argument(
        "--samples",
        type=int,
        default=20_000,
        metavar="N",
        help="random postures for the cloud of tool points (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of the random postures (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, metavar="FILE.npz", help="file for map and cloud")
    parser.add_argument(
        "--ply", type=Path, metavar="FILE.ply", help="file for the map as coloured points"
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="spread the work over the Dask cluster of this scheduler, such as "
        "tcp://10.0.0.1:8786; needs the extra `dask`",
    )
