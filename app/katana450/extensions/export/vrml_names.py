"""VRML names of all named nodes, in exported files and on a running server."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material
from katana450.extensions.export.names import distinct
from katana450.extensions.export.vrml_node import KEYWORDS

CLOCK = "Clock"
"""Name of the TimeSensor."""

LOOK, PAINT = "look", "paint"
"""Suffixes for a link with shapes: the Switch between its materials and one colour, and the
Material of that colour.
"""


@dataclass(frozen=True)
class NodeNames:
    """Names of the nodes that define the appearance of a link or object: Switch and Material."""

    appearance: str
    paint: str


class VrmlNames:
    """Distinct VRML names for everything of a robot, for any names in its URDF.

    Attributes:
        links: VRML name of each link, by its own name.
        joints: VRML name of each joint, by its own name.
        dressed: names of the appearance of each link with a shape.
        clock: name of the TimeSensor of a motion.
        way: suffix of a joint's name for its interpolator.
        surface: suffix, before a number, of a link's name for its face sets.
    """

    def __init__(self, robot: Robot) -> None:
        """Derive the names from ``robot``."""
        links = [link.name for link in robot.links]
        shown = [link.name for link in robot.links if link.shapes]
        materials = {shape.material for link in robot.links for shape in link.shapes}
        ordered = sorted(materials, key=repr)
        requested = [
            *links,
            *robot.joints,
            *(f"{name}_{part}" for name in shown for part in (LOOK, PAINT)),
            *(material.name for material in ordered),
            CLOCK,
        ]
        self._made = distinct(requested, KEYWORDS)
        unused = iter(self._made)
        self.links: Mapping[str, str] = {name: next(unused) for name in links}
        self.joints: Mapping[str, str] = {name: next(unused) for name in robot.joints}
        self.dressed: Mapping[str, NodeNames] = {
            name: NodeNames(next(unused), next(unused)) for name in shown
        }
        self._appearances = {material: next(unused) for material in ordered}
        self.clock = next(unused)
        self.way = "_motion"
        while any(f"{joint}{self.way}" in self._made for joint in self.joints.values()):
            self.way += "_"
        self.surface = "_surface"
        """Put, with a number, behind a link's name for its face sets."""
        while any(f"{link}{self.surface}" in name for link in links for name in self._made):
            self.surface += "_"

    def appearance(self, material: Material) -> str:
        """Return the name of the Appearance of ``material``."""
        return self._appearances[material]

    def objects(self, names: Sequence[str]) -> Mapping[str, tuple[str, NodeNames]]:
        """Return the names of the Transform and the appearance of each object.

        They follow after all names in the exported files.
        """
        requested = [part for name in names for part in (name, f"{name}_{LOOK}", f"{name}_{PAINT}")]
        unused = iter(distinct([*self._made, *requested], KEYWORDS)[len(self._made) :])
        return {name: (next(unused), NodeNames(next(unused), next(unused))) for name in names}
