"""Whether a file is a robot description at all, before its robot is read."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from app.errors import RobotDescriptionError


def check_description(path: Path) -> None:
    """Nothing, where `path` is XML of a robot with a name.

    Readers mend broken XML as they think best, and what they make of it hides what is wrong. Raises
    RobotDescriptionError, which says what that is.
    """
    if not path.is_file():
        raise RobotDescriptionError(f"There is no robot description at {path}.")
    wrong = f"{path} is not a robot description:"
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ValueError, LookupError, ElementTree.ParseError) as error:
        raise RobotDescriptionError(f"{wrong} its XML is broken, {error}.") from error
    if root.tag != "robot":
        raise RobotDescriptionError(f"{wrong} its outermost element is <{root.tag}>, not <robot>.")
    if not root.get("name"):
        raise RobotDescriptionError(f"{wrong} its <robot> has no name.")
