"""The command ``katana450 arms``, and the choice of a robot by ``--arm``."""

from __future__ import annotations

import sys
from argparse import Namespace

from katana450.errors import ConfigurationError
from katana450.extensions.gallery.download import file_of
from katana450.extensions.gallery.listed_robot import ListedRobot, listed_robots, robot_named
from katana450.resources import URDF_PATH

NOTE = (
    "Each description has the licence that its repository states. It covers the meshes too, "
    "unless the text says otherwise. Nothing of them is part of this program."
)


def arms(options: Namespace) -> int:
    """Print the list, or the file and licence of one robot. Raises KatanaError."""
    if options.name is not None:
        robot = robot_named(options.name)
        print(file_of(robot))
        print(f"katana450: {credit(robot)}", file=sys.stderr)
        return 0
    robots = [each for each in listed_robots().values() if each.urdf]
    if options.find is not None:
        word = options.find.lower()
        robots = [
            each for each in robots if word in f"{each.name} {each.robot} {each.maker}".lower()
        ]
        if not robots:
            raise ConfigurationError(f"No robot of the gallery has {options.find!r} in its name.")
    rows = [(each.name, each.robot, each.maker, each.licence) for each in robots]
    rows.insert(0, ("NAME", "ROBOT", "MAKER", "LICENCE"))
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    for row in rows:
        print("  ".join((*(text.ljust(n) for text, n in zip(row, widths, strict=False)), row[3])))
    print(f"\n{len(robots)} robots. {NOTE}")
    return 0


def choose(options: Namespace, name: str) -> None:
    """Let ``options`` name the file of the robot ``name`` of the gallery. Raises KatanaError."""
    if options.urdf != URDF_PATH:
        raise ConfigurationError("--arm NAME and --urdf name two robots. Leave one of them out.")
    robot = robot_named(name)
    options.urdf, options.arm = file_of(robot), None
    # Standard output is for the answers of the command.
    print(f"katana450: {credit(robot)}", file=sys.stderr, flush=True)


def credit(robot: ListedRobot) -> str:
    """Return maker, source and licence of the description of ``robot`` as sentences."""
    maker = f" by {robot.maker}" if robot.maker else ""
    source = f", described in {robot.source}" if robot.source else ""
    where = f" ({robot.licence_url})" if robot.licence_url else ""
    return f"{robot.robot}{maker}{source}. Licence of the description: {robot.licence}{where}."
