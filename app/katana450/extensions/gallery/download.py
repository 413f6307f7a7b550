"""The file of one robot of the gallery, downloaded by the package on first use."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import redirect_stdout
from functools import partial
from importlib import import_module
from pathlib import Path
from sys import stderr
from types import ModuleType
from xml.etree.ElementTree import fromstring

from katana450.arm.robot.description import checked
from katana450.errors import ConfigurationError
from katana450.extensions.derived_urdf import derived_urdf
from katana450.extensions.gallery.listed_robot import ListedRobot
from katana450.extensions.xacro.ros_package import package_folder
from katana450.extensions.xacro.xacro_file import expanded

PACKAGE_NAME = re.compile(r"package://([A-Za-z][\w-]*)/")
"""The beginning of the name of a mesh in a package of ROS."""


def file_of(robot: ListedRobot) -> Path:
    """Return the URDF file of ``robot``, which is downloaded if it is not on this machine.

    Raises ConfigurationError that says what to do: no git, no network, or a file that is missing.
    """
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
    try:
        # The package reports its progress on standard output, which is for our own answers.
        with redirect_stdout(stderr):
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


def _reason(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines()]
    told = [line for line in lines if "fatal:" in line or "error:" in line]
    text = (told or [line for line in lines if line] or [type(error).__name__])[-1]
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
