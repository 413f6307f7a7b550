"""VRML names of all named nodes, in exported files and on a running server."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material
from katana450.extensions.export.files import distinct
from katana450.extensions.export.vrml.vrml_world import KEYWORDS


class VrmlNames:
    """Distinct VRML names for everything of a robot, for any names in its URDF.

    Attributes:
        links: VRML name of each link, by its own name.
        joints: VRML name of each joint, by its own name.
        appearances: name of the Appearance of each material.
    """

    def __init__(self, robot: Robot) -> None:
        """Derive the names from ``robot``."""
        links = [link.name for link in robot.links]
        materials = {shape.material for link in robot.links for shape in link.shapes}
        ordered = sorted(materials, key=repr)
        requested = [
            *links,
            *robot.joints,
            *(material.name for material in ordered),
        ]
        self._made = distinct(requested, KEYWORDS)
        unused = iter(self._made)
        self.links: Mapping[str, str] = {name: next(unused) for name in links}
        self.joints: Mapping[str, str] = {name: next(unused) for name in robot.joints}
        self.appearances: Mapping[Material, str] = {
            appearance: next(unused) for appearance in ordered
        }

    def objects(self, names: Sequence[str]) -> Mapping[str, str]:
        """Return the name of the Transform of each object.

        They follow after all names in the exported files.
        """
        others = distinct([*self._made, *names], KEYWORDS)[len(self._made) :]
        return dict(zip(names, others, strict=True))
