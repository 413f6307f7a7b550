"""Options of ``katana450 run`` and ``katana450 demo``."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from katana450.extensions.programs.script.demos import CircleDemo, PourDemo
from katana450.extensions.real_arm.plant.axis import PROFILES
from katana450.resources import URDF_PATH

URL = "http://127.0.0.1:8080"
"""Default address of the server."""


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 run`` to ``parser``."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a script; see docs/programs.md")
    parser.add_argument(
        "--from-step",
        type=_step,
        metavar="N",
        help="begin at this step, from 1, where the arm stands; steps before it only choose the "
        "tool frame and the speed",
    )
    parser.add_argument(
        "--pause-before",
        type=_steps,
        default=(),
        metavar="N,...",
        help="pause before these steps, from 1, until the program is resumed",
    )
    _add_common(parser)


def add_demo_options(parser: argparse.ArgumentParser) -> None:
    """Add the demos and their options to ``parser``."""
    parser.set_defaults(from_step=None, pause_before=())
    demos = parser.add_subparsers(dest="demo", required=True, metavar="DEMO")
    circle = demos.add_parser("circle", help="the circle of the paper, or any other circle")
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
        help="flange (the arm without its gripper), or a tool frame between the fingers",
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
            help=f"place of the {name} on the table in mm (default: unchanged)",
        )
    pour.add_argument(
        "--shake", type=int, default=water.shake, metavar="N", help="number of shakes (default: 3)"
    )
    _add_common(pour)


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--headless", action="store_true", help="simulate, without server and browser"
    )
    parser.add_argument("--dry-run", action="store_true", help="only plan, and print the tasks")
    parser.add_argument(
        "--report", type=Path, metavar="DIR", help="write figures, measures and a table of the run"
    )
    parser.add_argument(
        "--speed", type=_fraction, default=1.0, help="fraction of its own speed (default: 1)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of the paths round obstacles (default: 0)"
    )
    parser.add_argument(
        "--url",
        default=URL,
        help="address of the server (default: %(default)s); if none answers on this machine, "
        "one is started",
    )
    parser.add_argument(
        "--unattended",
        action="store_true",
        help="let the program run on when this command is ended or loses its connection",
    )
    parser.add_argument(
        "--token", default="", help="token of an access link, if the server needs one"
    )
    parser.add_argument(
        "--urdf", type=Path, default=URDF_PATH, metavar="FILE", help="another arm, for --headless"
    )
    parser.add_argument(
        "--plant",
        choices=sorted(PROFILES),
        help="simulate an arm with inertia, delay, friction, droop and backlash; for --headless, "
        "--report, and a server that is started (default: an ideal arm)",
    )
    parser.add_argument(
        "--scene",
        type=Path,
        metavar="FILE",
        help="the scene in which it begins: a scene.yaml with its meshes beside it, or a .zip of "
        "both; for --headless, --dry-run, and a server that is started",
    )


def _spot(text: str) -> tuple[float, float]:
    parts = text.split(",")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(f"expected two numbers X,Y in mm, not {text!r}")
    return _number(parts[0]), _number(parts[1])


def _fraction(text: str) -> float:
    # Imported here, because it loads numpy.
    from katana450.arm.control.commands import MIN_SPEED

    value = _number(text)
    if not MIN_SPEED <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"expected a fraction from {MIN_SPEED} to 1, not {text!r}")
    return value


def _step(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a step, from 1, not {text!r}")
    return int(text)


def _steps(text: str) -> tuple[int, ...]:
    return tuple(_step(number) for number in text.split(","))


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a number, not {text!r}")
    return value


def _point(text: str) -> tuple[float, float, float]:
    parts = text.split(",")
    if len(parts) != 3:
        raise argparse.ArgumentTypeError(f"expected three comma-separated numbers, not {text!r}")
    x, y, z = (_number(part) for part in parts)
    return x, y, z


def _direction(text: str) -> str:
    if text.removeprefix("-") in ("x", "y", "z"):
        return text
    x, y, z = _point(text)
    return f"[{x:g}, {y:g}, {z:g}]"


def _pitch(text: str) -> str:
    return text if text in ("keep", "roomiest") else f"{_number(text):g}"
