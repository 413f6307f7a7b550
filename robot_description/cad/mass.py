"""Mass, centre of mass and inertia of each link, from its solids, written into the URDF.

A link is its outer shape with a motor inside. The castings are hollow and contain gears and boards
that are not drawn. Therefore all materials of a link count with one fraction of their density,
chosen so that the mass of the link including the motor is correct. Overlapping bodies count once,
as the denser one.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from robot_description.cad.build import MILLIMETRE, parts
from robot_description.cad.material import (
    ALUMINIUM,
    BIRCH,
    BLUE,
    BRASS,
    BRIGHT,
    GREEN,
    GREY,
    LAMINATE,
    LENS,
    MELAMINE,
    PAD,
    PANEL,
    PLASTIC,
    PRINT,
    RIM,
    RUBBER,
    SERVO,
    STEEL,
    Material,
)
from robot_description.cad.part import Part
from robot_description.cad.solid import Direction, Point, rod

DENSITY: Mapping[Material, float] = {  # kg/m^3
    BRASS: 8500.0,
    STEEL: 7850.0,
    ALUMINIUM: 2700.0,
    GREY: 2700.0,
    BRIGHT: 2700.0,
    SERVO: 1550.0,
    MELAMINE: 1500.0,
    RIM: 1500.0,
    LAMINATE: 1400.0,
    PLASTIC: 1300.0,
    PANEL: 1300.0,
    GREEN: 1300.0,
    BLUE: 1300.0,
    LENS: 1300.0,
    RUBBER: 1200.0,
    PAD: 1200.0,
    PRINT: 840.0,
    BIRCH: 680.0,
}
"""Sorted by density, highest first: where two materials overlap, the first one counts."""

LINK_MASS: Mapping[str, float] = {  # kg; the arm without its box has 4.80
    "base_link": 4.471,
    "arm_base_link": 1.405,
    "pan_link": 0.748,
    "upper_arm_link": 0.802,
    "forearm_link": 0.792,
    "wrist_link": 0.691,
    "roll_link": 0.256,
    "gripper_link": 0.056,
    "finger_right_link": 0.025,
    "finger_left_link": 0.025,
}


@dataclass(frozen=True)
class Motor:
    """A motor inside a link: catalogue mass in kg, diameter and length in mm, and its centre."""

    mass: float
    diameter: float
    length: float
    at: Point
    toward: Direction


MOTORS: Mapping[str, Motor] = {
    "arm_base_link": Motor(0.156, 26.0, 57.0, (0.0, 0.0, 85.0), "+z"),
    "pan_link": Motor(0.156, 26.0, 57.0, (0.0, 0.0, -44.0), "+y"),
    "upper_arm_link": Motor(0.114, 26.0, 42.0, (190.0, 0.0, 0.0), "+y"),
    "forearm_link": Motor(0.114, 26.0, 42.0, (139.0, 0.0, 0.0), "+y"),
    "wrist_link": Motor(0.046, 22.0, 24.0, (95.0, 0.0, 0.0), "+x"),
    "roll_link": Motor(0.046, 22.0, 24.0, (0.0, 0.0, 0.0), "+x"),
}


@dataclass(frozen=True)
class Moments:
    """Zeroth, first and second moments of mass about the origin: kg, kg m (3,), kg m^2 (3, 3)."""

    mass: float
    first: NDArray[np.float64]
    second: NDArray[np.float64]

    def __add__(self, other: Moments) -> Moments:
        """Return the moments of both shapes together."""
        return Moments(self.mass + other.mass, self.first + other.first, self.second + other.second)

    def times(self, factor: float) -> Moments:
        """Return the moments of the same shape with ``factor`` times the density."""
        return Moments(factor * self.mass, factor * self.first, factor * self.second)


@dataclass(frozen=True)
class Inertial:
    """The inertial values of a link in a URDF.

    Attributes:
        mass: kg.
        centre: (3,) centre of mass in m.
        inertia: (3, 3) about the centre of mass in kg m^2.
        fill: fraction of the materials' density that the link's hollow castings have.
    """

    mass: float
    centre: NDArray[np.float64]
    inertia: NDArray[np.float64]
    fill: float


def moments(solid: Manifold, density: float = 1.0) -> Moments:
    """Return the moments of ``solid`` (mm) at ``density`` kg/m^3, exact for its triangles.

    Each triangle spans a tetrahedron with the origin, whose signed moments are summed (Tonon,
    Explicit exact formulas for the 3-D tetrahedron inertia tensor, J. Math. Stat. 1, 2005).
    """
    mesh = solid.to_mesh64()
    corner = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3] * MILLIMETRE
    a, b, c = (corner[index] for index in np.asarray(mesh.tri_verts, dtype=np.int64).T)
    weight = density * (a * np.cross(b, c)).sum(axis=1) / 6.0
    total = a + b + c
    squares = [weight[:, None] * p for p in (a, b, c, total)]
    second = sum(
        (p.T @ q for p, q in zip(squares, (a, b, c, total), strict=True)), np.zeros((3, 3))
    )
    return Moments(
        float(weight.sum()),
        (weight[:, None] * total).sum(axis=0) / 4.0,
        (second + second.T) / 40.0,
    )


def moments_of(part: Part) -> Moments:
    """Return the moments of ``part`` with every material at its full density."""
    solids = dict(part.bodies())
    taken = Manifold()
    whole = Moments(0.0, np.zeros(3), np.zeros((3, 3)))
    for material, density in DENSITY.items():
        if material in solids:
            whole = whole + moments(solids[material] - taken, density)
            taken = taken + solids[material]
    return whole


def inertial(part: Part, mass: float, motor: Motor | None = None) -> Inertial:
    """Return the inertial of ``part`` with a total mass of ``mass`` kg including ``motor``."""
    shell = moments_of(part)
    inside = Moments(0.0, np.zeros(3), np.zeros((3, 3)))
    if motor is not None:
        half = motor.length / 2
        body = moments(rod(motor.diameter, -half, half, motor.toward, motor.at))
        inside = body.times(motor.mass / body.mass)
    fill = (mass - inside.mass) / shell.mass
    whole = shell.times(fill) + inside
    centre = whole.first / whole.mass
    second = whole.second - whole.mass * np.outer(centre, centre)
    return Inertial(whole.mass, centre, np.trace(second) * np.eye(3) - second, fill)


@functools.cache
def inertials() -> Mapping[str, Inertial]:
    """Return the inertial of every link with a shape."""
    return {
        part.link: inertial(part, LINK_MASS[part.link], MOTORS.get(part.link)) for part in parts()
    }


def _text(value: float) -> str:
    """Return ``value`` with five digits, and zero for values that are zero by symmetry."""
    return f"{value:.5g}" if abs(value) > 1e-10 else "0"


def _block(found: Inertial) -> str:
    I = found.inertia  # noqa: E741
    centre = " ".join(f"{round(x, 6) + 0.0:g}" for x in found.centre)
    return (
        f'<inertial>\n      <origin xyz="{centre}"/>\n      <mass value="{found.mass:.6g}"/>\n'
        f'      <inertia ixx="{_text(I[0, 0])}" ixy="{_text(I[0, 1])}" ixz="{_text(I[0, 2])}"\n'
        f'               iyy="{_text(I[1, 1])}" iyz="{_text(I[1, 2])}" izz="{_text(I[2, 2])}"/>\n'
        "    </inertial>"
    )


def with_inertials(urdf: str, found: Mapping[str, Inertial]) -> str:
    """Return the text ``urdf`` with the <inertial> of each link replaced, and all else unchanged.

    Raises:
        ValueError: a link has no <inertial> to replace.
    """
    for link, values in found.items():
        pattern = rf'(<link name="{link}">(?:(?!</link>).)*?)<inertial>.*?</inertial>'
        urdf, count = re.subn(pattern, rf"\g<1>{_block(values)}", urdf, flags=re.DOTALL)
        if count != 1:
            raise ValueError(f"the URDF has no <inertial> in link {link}: give it an empty one")
    return urdf


def write_inertials(urdf: Path) -> None:
    """Rewrite the <inertial> elements of the file ``urdf`` from the solids."""
    urdf.write_text(with_inertials(urdf.read_text("utf-8"), inertials()), "utf-8")
