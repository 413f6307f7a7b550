"""A file in which the joints that closed loops move follow others, in place of the loops."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, fromstring

import numpy as np

from katana450.arm.robot.description import explained
from katana450.arm.robot.urdf import urdf_of
from katana450.assembly.robot_files import read_urdf
from katana450.errors import RobotDescriptionError
from katana450.extensions.derived_urdf import derived_urdf
from katana450.extensions.loops.closure import KINDS, JointLoop, closures
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray


def solved_file(path: Path) -> Path:
    """Return a file with the robot at ``path`` as a tree with followers, without loops.

    Raises RobotDescriptionError with the loop that cannot be solved.
    """
    data = read_urdf(path)
    with explained(path):
        root, urdf = fromstring(data), urdf_of(data, path.parent)
        loops = [_loop(element, set(urdf.links), path) for element in root.findall("loop_joint")]
        found = [each.followers() for each in closures(urdf, loops, path.name)]
        followers = {each.joint: each for some in found for each in some}
    for element in root.findall("loop_joint"):
        root.remove(element)
    for joint in root.findall("joint"):
        follower = followers.get(joint.attrib["name"])
        if follower is not None:
            factor, offset = repr(follower.factor), repr(follower.offset)
            SubElement(joint, "mimic", joint=follower.driver, multiplier=factor, offset=offset)
    return derived_urdf(root, path, "loops")


def _loop(element: Element, links: set[str], path: Path) -> JointLoop:
    """Return the loop of an element <loop_joint>, as Drake and Isaac Sim write it."""
    name, kind = element.get("name", "without a name"), element.get("type", "")
    where = f"{path.name}: <loop_joint> {name!r}"
    # Isaac Sim names both ends link1.
    ends = [each for each in element if each.tag in ("link1", "link2")]
    named = tuple(end.get("link", "") for end in ends)
    if kind not in KINDS:
        raise RobotDescriptionError(
            f"{where} is of the type {kind!r}; closed loops are solved for {', '.join(KINDS)}."
        )
    if len(named) != 2 or not {*named} <= links:
        raise RobotDescriptionError(
            f"{where} must name two links of the robot in <link1> and <link2>, not "
            f"{', '.join(map(repr, named)) or 'none'}."
        )
    places = tuple(
        se3.from_rotation_translation(
            so3.from_rpy(*_numbers(end, "rpy", where).tolist()), _numbers(end, "xyz", where)
        )
        for end in ends
    )
    stated = element.find("axis")
    axis = np.array((1.0, 0.0, 0.0)) if stated is None else _numbers(stated, "xyz", where)
    size = float(np.linalg.norm(axis))
    if not size > 0.0:
        raise RobotDescriptionError(f"{where} has no axis.")
    return JointLoop(name, kind, (named[0], named[1]), (places[0], places[1]), axis / size)


def _numbers(element: Element, attribute: str, where: str) -> FloatArray:
    text = element.get(attribute, "0 0 0")
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise RobotDescriptionError(f"{where}: {attribute}={text!r} must be 3 finite numbers.")
    return numbers
