"""The command ``katana450 arms``, and the choice of a robot by ``--arm``."""

from __future__ import annotations

import os
import re
import sys
from argparse import Namespace
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, TextIO
from xml.etree.ElementTree import fromstring

from katana450.arm.robot.description import checked
from katana450.errors import ConfigurationError
from katana450.extensions.derived_urdf import derived_urdf
from katana450.extensions.xacro.xacro_file import expanded
from katana450.extensions.xacro.xacro_process import package_folder
from katana450.extras import library
from katana450.resources import INCLUDED, URDF_PATH

PACKAGE = "robot_descriptions"

ENDING = "_description"
"""End of the names in the package, which a person may leave out."""

ALIASES: Mapping[str, str] = {
    "allegro": "allegro_hand",
    "koch": "koch_arm",
    "so100": "so_arm100",
}
"""Common names, in the form of ``_plain``, and those of the package."""


@dataclass(frozen=True)
class ListedRobot:
    """One description of the package, or of this distribution.

    Attributes:
        name: without the ending.
        robot, maker: names for people; the maker may be empty.
        licence: SPDX identifier, or what the package states.
        licence_url: address of the text; empty if the package does not give it.
        source: address of the repository; empty if the package does not give it.
        urdf: whether it is a URDF or xacro file.
        is_arm: whether it is an arm, and not another kind of robot or a hand.
        file: that of a robot of this distribution; None for one of the package.
    """

    name: str
    robot: str
    maker: str
    licence: str
    licence_url: str
    source: str
    urdf: bool
    is_arm: bool
    file: Path | None = None

    @property
    def alias(self) -> str:
        """Its common name, if that is another one; empty otherwise."""
        return next((alias for alias, name in ALIASES.items() if name == self.name), "")

    @property
    def module(self) -> str:
        """Module of the package. Importing it downloads the files."""
        return f"{PACKAGE}.{self.name}{ENDING}"


INCLUDED_ROBOTS: Mapping[str, ListedRobot] = {
    name: ListedRobot(name, robot, maker, "MIT", "", "", True, True, INCLUDED[name])
    for name, robot, maker in (
        ("katana450", "Katana450", "Neuronics"),
        ("so101", "SO-101", "The Robot Studio"),
    )
}
"""The robots of this distribution by name: their descriptions are its own."""


def listed_robots() -> dict[str, ListedRobot]:
    """Return the package's descriptions by name. Raises ConfigurationError without the package."""
    descriptions = library(PACKAGE, "gallery", "Robots of the gallery").DESCRIPTIONS
    repositories = import_module(f"{PACKAGE}._repositories").REPOSITORIES
    robots = [
        _listed(key, description, repositories) for key, description in sorted(descriptions.items())
    ]
    return {robot.name: robot for robot in robots}


def robot_named(name: str) -> ListedRobot:
    """Return the robot of that name, in any case and with or without hyphens.

    Raises ConfigurationError with the nearest names if there is none, or if it has no URDF.
    """
    if _plain(name) in INCLUDED_ROBOTS:
        return INCLUDED_ROBOTS[_plain(name)]
    robots = {robot.name: robot for robot in listed_robots().values() if robot.urdf}
    others = {robot.name for robot in listed_robots().values()} - set(robots)
    wanted = _plain(name)
    wanted = _plain(ALIASES.get(wanted, wanted))
    by_plain = {_plain(listed): listed for listed in robots}
    if wanted in by_plain:
        return robots[by_plain[wanted]]
    if wanted in map(_plain, others):
        problem = f"The gallery has {name!r} as MJCF only, which cannot be read."
    else:
        problem = f"The gallery has no robot {name!r}."
    names = [by_plain[plain] for plain in get_close_matches(wanted, by_plain, cutoff=0.5)]
    hint = f" Nearest names: {', '.join(names)}." if names else ""
    raise ConfigurationError(f"{problem}{hint} `katana450 arms` lists all.")


def _listed(key: str, description: Any, repositories: Mapping[str, Any]) -> ListedRobot:
    repository = repositories.get(description.repository)
    url = "" if repository is None else repository.url.removesuffix(".git")
    file = description.license_file
    return ListedRobot(
        name=key.removesuffix(ENDING),
        robot=description.robot,
        maker=description.maker or "",
        licence=description.license_spdx or "not stated",
        licence_url=f"{url}/blob/{repository.commit}/{file}" if repository and file else "",
        source=url,
        urdf=description.has_urdf,
        is_arm="arm" in description.tags,
    )


def _plain(name: str) -> str:
    """Return ``name`` in small letters and digits alone, without the ending."""
    return re.sub("[^a-z0-9]", "", name.lower().removesuffix(ENDING))


PACKAGE_NAME = re.compile(r"package://([A-Za-z][\w-]*)/")
"""The beginning of the name of a mesh in a package of ROS."""


def file_of(robot: ListedRobot) -> Path:
    """Return the URDF file of ``robot``, which is downloaded if it is not on this machine.

    Raises ConfigurationError that says what to do: no git, no network, or a file that is missing.
    """
    if robot.file is not None:
        return robot.file
    module = _downloaded(robot)
    urdf = getattr(module, "URDF_PATH", None)
    if urdf is not None:
        return _existing(robot, Path(urdf))
    xacro = getattr(module, "XACRO_PATH", None)
    if xacro is None:
        raise ConfigurationError(
            f"The description of {robot.name} names no URDF file. Choose another robot from "
            "`katana450 arms`."
        )
    packages = getattr(module, "XACRO_PACKAGE_PATHS", {})
    return _expanded_file(_existing(robot, Path(xacro)), _arguments(module), packages)


def _downloaded(robot: ListedRobot) -> ModuleType:
    """Return the module of ``robot``, whose import clones its repository with git."""
    # The package reports its progress on standard output, which is for our own answers.
    output = _ProgressOutput(sys.stderr)
    try:
        with redirect_stdout(output), redirect_stderr(output):
            return import_module(robot.module)
    except ImportError as error:
        if "git" in str(error).lower():
            raise ConfigurationError(
                f"{robot.name} cannot be downloaded: the gallery needs the program git. Install "
                "git."
            ) from error
        raise ConfigurationError(
            f"{robot.name} cannot be loaded from the gallery: {error}."
        ) from error
    except Exception as error:
        # git reports what failed, whatever class its error has.
        raise ConfigurationError(
            f"{robot.name} cannot be downloaded from {robot.source or 'its repository'}: "
            f"{_reason(error)} Check the connection to the network. Robots that were downloaded "
            "before need none."
        ) from error
    finally:
        output.end()


class _ProgressOutput:
    """A stream for the progress of a download, whose last line ends before an error is printed."""

    def __init__(self, stream: TextIO) -> None:
        self._stream: TextIO | None = stream
        self._last = "\n"

    def write(self, text: str) -> int:
        if self._stream is not None and text:
            self._last = text[-1]
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        if self._stream is not None:
            self._stream.flush()

    def isatty(self) -> bool:
        return self._stream is not None and self._stream.isatty()

    def end(self) -> None:
        """End the line, and ignore what comes later, as from a bar that is closed at last."""
        if self._last != "\n":
            self.write("\n")
        self._stream = None


def _reason(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines()]
    errors = [line for line in lines if "fatal:" in line or "error:" in line]
    text = (errors or [line for line in lines if line] or [type(error).__name__])[-1]
    text = re.sub(r"^(stderr:\s*)?['\"]*(fatal|error):\s*", "", text).strip("'\" .")
    return f"{text[:1].upper()}{text[1:]}."


def _existing(robot: ListedRobot, file: Path) -> Path:
    if not file.is_file():
        raise ConfigurationError(
            f"The download of {robot.name} is not complete: there is no {file}. Delete "
            f"{file.parent} and try again."
        )
    return file


def _arguments(module: ModuleType) -> dict[str, str]:
    return {str(name): str(value) for name, value in getattr(module, "XACRO_ARGS", {}).items()}


def _expanded_file(xacro: Path, arguments: Mapping[str, str], packages: Mapping[str, str]) -> Path:
    """Return a file with the expansion of ``xacro``, in this user's folder for such files."""
    before = os.environ.get("ROS_PACKAGE_PATH")
    folders = [*map(str, packages.values()), *([before] if before else [])]
    try:
        if folders:
            os.environ["ROS_PACKAGE_PATH"] = os.pathsep.join(folders)
        text = checked(xacro, partial(expanded, arguments=arguments)).decode()

        def absolute(match: re.Match[str]) -> str:
            folder = package_folder(match[1], xacro.parent)
            return match[0] if folder is None else f"file://{folder.resolve()}/"

        text = PACKAGE_NAME.sub(absolute, text)
    finally:
        if before is None:
            os.environ.pop("ROS_PACKAGE_PATH", None)
        else:
            os.environ["ROS_PACKAGE_PATH"] = before
    return derived_urdf(fromstring(text), xacro, "gallery")


NOTE = (
    "katana450 and so101 are included. Each other description has the licence that its repository "
    "states. It covers the meshes too, unless the text says otherwise."
)


def arms(options: Namespace) -> int:
    """Print the list, or the file and licence of one robot. Raises KatanaError."""
    if options.name is not None:
        robot = robot_named(options.name)
        print(file_of(robot))
        print(f"katana450: {credit(robot)}", file=sys.stderr)
        return 0
    robots, note = [*INCLUDED_ROBOTS.values()], NOTE
    try:
        robots += [listed for listed in listed_robots().values() if listed.urdf]
    except ConfigurationError as error:
        note = str(error)
    rows = [(listed.name, listed.robot, listed.maker, listed.licence) for listed in robots]
    rows.insert(0, ("NAME", "ROBOT", "MAKER", "LICENCE"))
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    for row in rows:
        print("  ".join((*(text.ljust(n) for text, n in zip(row, widths, strict=False)), row[3])))
    print(f"\n{len(robots)} robots. {note}")
    return 0


def choose(options: Namespace, name: str) -> None:
    """Let ``options`` name the file of the robot ``name`` of the gallery. Raises KatanaError."""
    if options.urdf != URDF_PATH:
        raise ConfigurationError("--arm NAME and --urdf name two robots. Leave one of them out.")
    robot = robot_named(name)
    options.urdf, options.arm = file_of(robot), None
    if robot.file is None:
        # Standard output is for the answers of the command.
        print(f"katana450: {credit(robot)}", file=sys.stderr, flush=True)


def credit(robot: ListedRobot) -> str:
    """Return maker, source and licence of the description of ``robot`` as sentences."""
    maker = f" by {robot.maker}" if robot.maker else ""
    source = f", described in {robot.source}" if robot.source else ""
    where = f" ({robot.licence_url})" if robot.licence_url else ""
    return f"{robot.robot}{maker}{source}. Licence of the description: {robot.licence}{where}."
