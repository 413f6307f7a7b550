"""VRML's names for all that has one, in the files that are written and on a running server."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material
from katana450.extensions.export.names import distinct
from katana450.extensions.export.vrml_node import KEYWORDS

CLOCK = "Clock"

LOOK, PAINT = "look", "paint"
"""Of a link that has shapes: the Switch between what it is made of and one colour all over, and the
Material of that colour."""


@dataclass(frozen=True)
class NodeNames:
    """The nodes that say how a link or an object is shown."""

    appearance: str
    paint: str


class VrmlNames:
    """No two alike, however the URDF calls them.

    Attributes:
        links, joints: the name of each, by its own.
        dressed: of each link that has a shape.
        clock: of the TimeSensor of a motion.
        way: what is put behind a joint's name for its interpolator.
    """

    def __init__(self, robot: Robot) -> None:
        links = [link.name for link in robot.links]
        shown = [link.name for link in robot.links if link.shapes]
        materials = {shape.material for link in robot.links for shape in link.shapes}
        ordered = sorted(materials, key=repr)
        wanted = [
            *links,
            *robot.joints,
            *(f"{name}_{part}" for name in shown for part in (LOOK, PAINT)),
            *(material.name for material in ordered),
            CLOCK,
        ]
        self._made = distinct(wanted, KEYWORDS)
        made = iter(self._made)
        self.links: Mapping[str, str] = {name: next(made) for name in links}
        self.joints: Mapping[str, str] = {name: next(made) for name in robot.joints}
        self.dressed: Mapping[str, NodeNames] = {
            name: NodeNames(next(made), next(made)) for name in shown
        }
        self._appearances = {material: next(made) for material in ordered}
        self.clock = next(made)
        self.way = "_motion"
        while any(f"{joint}{self.way}" in self._made for joint in self.joints.values()):
            self.way += "_"
        self.surface = "_surface"
        """Put, with a number, behind a link's name for its face sets."""
        while any(f"{link}{self.surface}" in name for link in links for name in self._made):
            self.surface += "_"

    def appearance(self, material: Material) -> str:
        """Of its Appearance."""
        return self._appearances[material]

    def objects(self, names: Sequence[str]) -> Mapping[str, tuple[str, NodeNames]]:
        """Of what stands around, by its own name: its Transform, and how it is shown.

        They come after all that is in the files.
        """
        wanted = [part for name in names for part in (name, f"{name}_{LOOK}", f"{name}_{PAINT}")]
        made = iter(distinct([*self._made, *wanted], KEYWORDS)[len(self._made) :])
        return {name: (next(made), NodeNames(next(made), next(made))) for name in names}
