"""Tests of the X3D export: read back exactly, and accepted by another program."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.export.vrml import view, world_of
from katana450.extensions.export.vrml_world import Node, Use, Value, World, x3d_text
from katana450.resources import URDF_PATH
from tests.exchange.conftest import GANTRY_POSE, POSES
from tests.exchange.silhouette import SIZE, overlap, placed, seen, silhouette
from tests.exchange.tools import SCREEN, needs, run
from tests.exchange.vrml_types import FIELDS, LISTS, WIDTHS, Type

INSIDE = {
    "Appearance": "appearance",
    "Material": "material",
    "IndexedFaceSet": "geometry",
    "Coordinate": "coord",
    "Normal": "normal",
}
"""The field of the parent for kinds of nodes that are no children."""


def world_in(text: str) -> World:
    """Return the world of an X3D file."""
    (scene,) = ElementTree.fromstring(text.partition("?>")[2])
    return World(tuple(node(each) for each in scene))  # type: ignore[misc]


def node(element: ElementTree.Element) -> Node | Use:
    if "USE" in element.attrib:
        return Use(element.attrib["USE"])
    fields: dict[str, Value] = {}
    for name, kind in FIELDS[element.tag].items():
        if name in element.attrib:
            fields[name] = value(kind, element.attrib[name])
        elif kind is Type.NODE:
            for each in element:
                if INSIDE[each.tag] == name:
                    fields[name] = node(each)
        elif kind is Type.NODE_LIST:
            fields[name] = [node(each) for each in element]
    return Node(element.tag, tuple(fields.items()), element.attrib.get("DEF"))


def value(kind: Type, text: str) -> Value:
    match kind:
        case Type.BOOL:
            return {"true": True, "false": False}[text]
        case Type.STRING:
            return text
        case Type.STRING_LIST:
            found = re.findall(r'"((?:[^"\\]|\\.)*)"', text)
            return [re.sub(r"\\(.)", r"\1", each) for each in found]
    number = int if kind in (Type.INT, Type.INT_LIST) else float
    numbers = [number(each) for each in text.split()]
    if kind in LISTS:
        return numbers
    return tuple(numbers) if WIDTHS[kind] > 1 else numbers[0]


def in_order(world: World) -> World:
    """Return the world with the fields of each node in the order of the table."""

    def ordered(part: Any) -> Any:
        if isinstance(part, list):
            return [ordered(each) for each in part]
        if not isinstance(part, Node):
            return part
        own = dict(part.fields)
        fields = ((name, ordered(own[name])) for name in FIELDS[part.kind] if name in own)
        return Node(part.kind, tuple(fields), part.name)

    return World(tuple(ordered([*world.nodes])))


@pytest.mark.parametrize("plain", [False, True])
def test_world_is_read_back(gantry: Robot, plain: bool) -> None:
    world = world_of(gantry, gantry.values(GANTRY_POSE), plain=plain)
    text = x3d_text(world)
    assert ("Switch" in text) is not plain
    assert world_in(text) == in_order(world)
    named = Node("WorldInfo", (("title", 'a "b" <c> & \\'), ("info", ['d "e"', "f\\"])))
    assert world_in(x3d_text(World((named,)))) == World((named,))


@pytest.mark.long
@needs("view3dscene", "xvfb-run", "xauth")
@pytest.mark.parametrize("pose", POSES)
def test_another_program_draws_the_file(
    tmp_path: Path, katana: Robot, pose: tuple[float, ...]
) -> None:
    values = ",".join(map(str, pose))
    options = ["--no-objects", "--out", str(tmp_path), f"--pose={values}"]
    assert main(["export", "x3d", *options]) == 0
    alone = ("--geometry", f"{SIZE}x{SIZE}", "--hide-extras", "--hide-menu")
    picture = tmp_path / "picture.png"
    shot = ("--screenshot", "0", picture)
    run(*SCREEN, "view3dscene", tmp_path / "katana450.x3d", *alone, *shot)
    ours = silhouette(placed(URDF_PATH, katana.values(pose)), view(katana, katana.values(pose)))
    assert overlap(seen(picture), ours) >= 0.98
    rows, columns = np.nonzero(ours)
    widest = max(np.ptp(rows), np.ptp(columns)) / SIZE
    assert 0.9 < widest < 1.0
