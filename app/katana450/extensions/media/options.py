"""Options of ``katana450 render``."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.cli.option_values import add_arm_options, size
from katana450.extensions.export.options import add_pose_option

CAMERAS = ("free", "front", "side", "top", "tool", "wrist")
"""Camera presets, as on the page, and the camera on the hand; the first is its 3D view."""


def add_render_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 render`` to ``parser``."""
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE",
        help="picture, a .png file",
    )
    add_pose_option(parser, "Home")
    parser.add_argument(
        "--camera", choices=CAMERAS, default=CAMERAS[0], help="view (default: %(default)s)"
    )
    parser.add_argument(
        "--size",
        type=size,
        default=(1280, 720),
        metavar="WxH",
        help="pixels (default: 1280x720)",
    )
    add_arm_options(parser, tool=False)
