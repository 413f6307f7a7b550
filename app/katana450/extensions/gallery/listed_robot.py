"""The robots of the package robot_descriptions: names, makers, formats and licences."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import Any

from katana450.errors import ConfigurationError
from katana450.extras import library

PACKAGE = "robot_descriptions"

ENDING = "_description"
"""End of the names in the package, which a person may leave out."""

ALIASES: Mapping[str, str] = {
    "allegro": "allegro_hand",
    "koch": "koch_arm",
    "openmanipulatorx": "open_manipulator_x",
    "so100": "so_arm100",
    "so101": "so_arm101",
}
"""Common names, in the form of ``_plain``, and those of the package."""

MAX_SUGGESTIONS = 4

SIMILAR = 0.5
"""Minimum similarity [1] of a name that is suggested."""


@dataclass(frozen=True)
class ListedRobot:
    """One description of the package.

    Attributes:
        name: without the ending.
        robot, maker: names for people; the maker may be empty.
        licence: SPDX identifier, or what the package states.
        licence_url: address of the text; empty if the package does not give it.
        source: address of the repository; empty if the package does not give it.
        urdf: whether it is a URDF or xacro file.
    """

    name: str
    robot: str
    maker: str
    licence: str
    licence_url: str
    source: str
    urdf: bool

    @property
    def module(self) -> str:
        """Module of the package. Importing it downloads the files."""
        return f"{PACKAGE}.{self.name}{ENDING}"


def listed_robots() -> dict[str, ListedRobot]:
    """Return all descriptions by name. Raises ConfigurationError without the package."""
    try:
        descriptions = library(PACKAGE, "gallery", "Robots of the gallery").DESCRIPTIONS
    except AttributeError as error:
        raise ConfigurationError(
            f"This version of {PACKAGE} has no list of robots. Install a newer one."
        ) from error
    repositories = _repositories()
    found = [_listed(key, each, repositories) for key, each in sorted(descriptions.items())]
    return {each.name: each for each in found}


def robot_named(name: str) -> ListedRobot:
    """Return the robot of that name, in any case and with or without hyphens.

    Raises ConfigurationError with the nearest names if there is none, or if it has no URDF.
    """
    robots = {each.name: each for each in listed_robots().values() if each.urdf}
    others = {each.name for each in listed_robots().values()} - set(robots)
    wanted = _plain(name)
    wanted = _plain(ALIASES.get(wanted, wanted))
    by_plain = {_plain(each): each for each in robots}
    if wanted in by_plain:
        return robots[by_plain[wanted]]
    known = {_plain(each.robot): each for each in reversed(robots.values())}
    if wanted in known:
        return known[wanted]
    if wanted in map(_plain, others):
        problem = f"The gallery has {name!r} as MJCF only, which cannot be read."
    else:
        problem = f"The gallery has no robot {name!r}."
    near = get_close_matches(wanted, (*by_plain, *known), MAX_SUGGESTIONS, SIMILAR)
    names = dict.fromkeys(by_plain.get(each) or known[each].name for each in near)
    hint = f" Nearest names: {', '.join(names)}." if names else ""
    raise ConfigurationError(f"{problem}{hint} `katana450 arms` lists all.")


def _listed(key: str, description: Any, repositories: Mapping[str, Any]) -> ListedRobot:
    # Older versions of the package lack some of these fields.
    repository = repositories.get(getattr(description, "repository", None) or "")
    url = "" if repository is None else repository.url.removesuffix(".git")
    file = getattr(description, "license_file", None)
    return ListedRobot(
        name=key.removesuffix(ENDING),
        robot=getattr(description, "robot", None) or key.removesuffix(ENDING),
        maker=getattr(description, "maker", None) or "",
        licence=getattr(description, "license_spdx", None) or "not stated",
        licence_url=f"{url}/blob/{repository.commit}/{file}" if repository and file else "",
        source=url,
        urdf=bool(description.has_urdf),
    )


def _repositories() -> Mapping[str, Any]:
    """Return the repositories of the package by name; none if this version keeps them elsewhere."""
    try:
        found: Mapping[str, Any] = import_module(f"{PACKAGE}._repositories").REPOSITORIES
    except (ImportError, AttributeError):
        return {}
    return found


def _plain(name: str) -> str:
    """Return ``name`` in small letters and digits alone, without the ending."""
    return re.sub("[^a-z0-9]", "", name.lower().removesuffix(ENDING))
