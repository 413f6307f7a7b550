"""VRML names of all named nodes, in exported files and on a running server."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material
from katana450.extensions.export.files import distinct
from katana450.extensions.export.vrml.vrml_world import KEYWORDS

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
        appearances: name of the Appearance of each material.
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
        ]
        self._made = distinct(requested, KEYWORDS)
        unused = iter(self._made)
        self.links: Mapping[str, str] = {name: next(unused) for name in links}
        self.joints: Mapping[str, str] = {name: next(unused) for name in robot.joints}
        self.dressed: Mapping[str, NodeNames] = {
            name: NodeNames(next(unused), next(unused)) for name in shown
        }
        self.appearances: Mapping[Material, str] = {
            appearance: next(unused) for appearance in ordered
        }

    def unused_suffix(self, suffix: str, others: Sequence[str] = ()) -> str:
        """Return ``suffix``, longer if a name with it would begin another name of the world.

        ``others``: names of the world beside those of the robot.
        """
        names = [name.lower() for name in (*self._made, *others)]
        while any(f"{name}{suffix}" in other for name in names for other in names):
            suffix += "_"
        return suffix

    def objects(self, names: Sequence[str]) -> Mapping[str, tuple[str, NodeNames]]:
        """Return the names of the Transform and the appearance of each object.

        They follow after all names in the exported files.
        """
        requested = [part for name in names for part in (name, f"{name}_{LOOK}", f"{name}_{PAINT}")]
        unused = iter(distinct([*self._made, *requested], KEYWORDS)[len(self._made) :])
        return {name: (next(unused), NodeNames(next(unused), next(unused))) for name in names}
