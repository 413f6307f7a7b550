"""The extension ``experiments``: the commands that run a script, or an experiment of the paper."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from katana450.extension import CliCommand, Extension
from katana450.extensions.programs.circle import CircleDemo
from katana450.extensions.programs.pour import PourDemo
from katana450.resources import URDF_PATH

URL = "http://127.0.0.1:8080"


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``run`` to ``parser``."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a script; see docs/programs.md")
    _add_common(parser)


def add_demo_options(parser: argparse.ArgumentParser) -> None:
    """Add the demos and their options to ``parser``."""
    demos = parser.add_subparsers(dest="demo", required=True, metavar="DEMO")
    circle = demos.add_parser("circle", help="the paper's circle, or any other")
    default = CircleDemo()
    circle.add_argument(
        "--centre",
        type=_point,
        default=default.centre,
        metavar="X,Y,Z",
        help="mm, in the frame {S} at the shoulder (default: 150,0,-110)",
    )
    circle.add_argument(
        "--normal",
        type=_direction,
        default=default.normal,
        metavar="DIR",
        help="x, y, z, -x, -y, -z or three numbers X,Y,Z (default: x)",
    )
    circle.add_argument("--radius", type=_number, default=default.radius, metavar="MM")
    circle.add_argument("--turns", type=_number, default=default.turns, metavar="N")
    circle.add_argument(
        "--tool",
        choices=("flange", "tcp", "grasp"),
        default=default.tool,
        help="flange, of an arm without its gripper, or a tool frame between the fingers",
    )
    circle.add_argument(
        "--pitch",
        type=_pitch,
        metavar="DEG",
        help="degrees, keep or roomiest (default: 99 for the flange, else roomiest)",
    )
    _add_common(circle)
    pour = demos.add_parser("pour", help="carry a cup of water to a basin and empty it there")
    water = PourDemo()
    pour.add_argument(
        "--water", type=_number, default=water.water, metavar="ML", help="default: %(default)g"
    )
    for name in ("cup", "basin"):
        pour.add_argument(
            f"--{name}",
            type=_spot,
            metavar="X,Y",
            help=f"mm on the table, where the {name} stands (default: where it is)",
        )
    pour.add_argument(
        "--shake", type=int, default=water.shake, metavar="N", help="times (default: 3)"
    )
    _add_common(pour)


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--headless", action="store_true", help="no server and no browser: on a clock of its own"
    )
    parser.add_argument("--dry-run", action="store_true", help="only plan it and tell what it does")
    parser.add_argument(
        "--report", type=Path, metavar="DIR", help="figures, measures and a table of the run"
    )
    parser.add_argument(
        "--speed", type=_fraction, default=1.0, help="fraction of its own speed (default: 1)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of the ways round what is in between (default: 0)"
    )
    parser.add_argument(
        "--url",
        default=URL,
        help="of the server that has the arm (default: %(default)s); where none answers on this "
        "machine, one is started",
    )
    parser.add_argument("--token", default="", help="of an access link, where one is asked for")
    parser.add_argument(
        "--urdf", type=Path, default=URDF_PATH, metavar="FILE", help="another arm, for --headless"
    )


def _spot(text: str) -> tuple[float, float]:
    parts = text.split(",")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(f"two numbers X,Y in mm, not {text!r}")
    return _number(parts[0]), _number(parts[1])


def _fraction(text: str) -> float:
    # Loads numpy, so only where a speed is given.
    from katana450.arm.control.commands import MIN_SPEED

    value = _number(text)
    if not MIN_SPEED <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"a fraction from {MIN_SPEED} to 1, not {text!r}")
    return value


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"a number, not {text!r}")
    return value


def _point(text: str) -> tuple[float, float, float]:
    parts = text.split(",")
    if len(parts) != 3:
        raise argparse.ArgumentTypeError(f"three numbers with commas between, not {text!r}")
    x, y, z = (_number(part) for part in parts)
    return x, y, z


def _direction(text: str) -> str:
    if text.removeprefix("-") in ("x", "y", "z"):
        return text
    x, y, z = _point(text)
    return f"[{x:g}, {y:g}, {z:g}]"


def _pitch(text: str) -> str:
    return text if text in ("keep", "roomiest") else f"{_number(text):g}"


def _run(options: argparse.Namespace) -> int:
    from katana450.extensions.experiments.run import run

    return run(options)


def _demo(options: argparse.Namespace) -> int:
    from katana450.extensions.experiments.run import demo

    return demo(options)


EXTENSION = Extension(
    "experiments",
    (
        CliCommand("run", "run a script of your own", add_run_options, _run),
        CliCommand("demo", "run an experiment of the paper", add_demo_options, _demo),
    ),
)
