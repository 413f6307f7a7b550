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
from katana450.extensions.export.vrml.vrml_files import view, world_of
from katana450.extensions.export.vrml.vrml_world import Node, Use, World, x3d_text
from katana450.resources import URDF_PATH
from tests.exchange.conftest import GANTRY_POSE, POSES
from tests.exchange.silhouette import SIZE, overlap, placed, seen, silhouette
from tests.exchange.tools import SCREEN, needs, run

Element = tuple[str, dict[str, Any], list[Any]]
"""Tag, attributes and children of an element."""


def read(element: ElementTree.Element) -> Element:
    attributes = {name: words(text) for name, text in element.attrib.items()}
    return element.tag, attributes, [read(child) for child in element]


def words(text: str) -> Any:
    """Return the numbers of an attribute, its texts in quotation marks, or itself."""
    if text.startswith('"'):
        return [re.sub(r"\\(.)", r"\1", string) for string in re.findall(TEXT, text)]
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return text


TEXT = r'"((?:[^"\\]|\\.)*)"'


def expected(node: Node | Use, kinds: dict[str, str]) -> Element:
    """Return the element of ``node``; ``kinds``: the kind of each node with a DEF name."""
    if isinstance(node, Use):
        return kinds[node.name], {"USE": node.name}, []
    attributes: dict[str, Any] = {} if node.name is None else {"DEF": node.name}
    children: list[Element] = []
    for name, value in node.fields:
        parts: list[Any] = [value]
        if isinstance(value, list | tuple) and not isinstance(value, Use):
            parts = [*value]
        if any(isinstance(part, Node | Use) for part in parts):
            children += [expected(part, kinds) for part in parts]
        elif isinstance(value, bool):
            attributes[name] = str(value).lower()
        elif value != []:
            attributes[name] = value if isinstance(value, str) else parts
    return node.kind, attributes, children


def check(world: World) -> None:
    """Check that the text of ``world`` has all that is in it."""
    text = x3d_text(world)
    kinds = {name: node.kind for name, node in world.named().items()}
    (scene,) = ElementTree.fromstring(text.partition("?>")[2])
    assert [read(child) for child in scene] == [expected(node, kinds) for node in world.nodes]


def test_world_is_read_back(gantry: Robot) -> None:
    check(world_of(gantry, gantry.values(GANTRY_POSE)))
    named = Node("WorldInfo", (("title", 'a "b" <c> & \\'), ("info", ['d "e"', "f\\"])))
    check(World((named,)))


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
