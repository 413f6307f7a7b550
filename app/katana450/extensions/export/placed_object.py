"""An object that stands beside the exported robot: the cup and the basin of a new server."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import VisualMesh, main_colour, shapes_of
from katana450.arm.robot.visual import Visual
from katana450.assembly.robot_session import arm_session
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.settings import Settings


@dataclass(frozen=True, eq=False)
class PlacedObject:
    """An object at its place.

    Attributes:
        name: its name on a server.
        T: (4, 4) its pose in the root's frame [m].
        shapes: its surfaces in its own frame.
    """

    name: str
    T: FloatArray
    shapes: Sequence[VisualMesh]

    @property
    def colour(self) -> tuple[float, float, float]:
        """The colour (sRGB, 0..1) of its largest part."""
        return main_colour(self.shapes)


def initial_objects(robot: Robot) -> tuple[PlacedObject, ...]:
    """Return the objects that a new server has around ``robot``; none without an arm."""
    if robot.arm is None:
        return ()
    props, ones = load_props(), frozen(np.ones(3))
    files = {"cup": props.cup.mesh, "basin": props.basin.mesh}
    session = arm_session(Settings(), robot).session
    return tuple(
        PlacedObject(
            each.name, each.T, shapes_of(Visual(frozen(np.eye(4)), ones, files[each.name]))
        )
        for each in session.begin(session.ready, 0.0, 0.0).objects
    )
