"""Random members of the family of arms, made from their offsets without code of the app."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

import numpy as np

from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from tests.kinematics.conftest import L1, L2, TOOL_LENGTHS, katana


@dataclasses.dataclass(frozen=True)
class Offsets:
    """The dimensions of a member; lengths in m, angles in rad.

    Attributes:
        radial, lateral: offset of the shoulder from axis 1.
        links: distances from axis 2 to 3, from 3 to 4, and from 4 to the foot of the tool point on
            the roll axis.
        bearings: angles of the links and of the roll axis above the horizontal at q = 0.
        roll_offset: offset of axis 4 from the roll axis, in the plane.
        signs: signs of the axes.
    """

    radial: float
    lateral: float
    links: tuple[float, float, float]
    bearings: tuple[float, float, float]
    roll_offset: float
    signs: tuple[int, int, int, int, int]

    @property
    def size(self) -> float:
        """An upper bound on the reach [m]."""
        return abs(self.radial) + abs(self.lateral) + sum(self.links) + abs(self.roll_offset)


KATANA = Offsets(
    0.0, 0.0, (L1, L2, TOOL_LENGTHS["tcp"]), (0.0, 0.0, 0.0), 0.0, signs=(1, 1, 1, 1, 1)
)
"""The dimensions of the Katana450."""


def random_offsets(rng: np.random.Generator, *, lateral: bool) -> Offsets:
    """Return random offsets; each is zero in some members, so that simple arms are tested too."""
    present = rng.random(4) < 0.7
    low, middle, high = rng.uniform(-math.pi, math.pi, 3) * present[0]
    one, two, three, four, five = rng.choice((-1, 1), size=5).tolist()
    return Offsets(
        radial=float(rng.uniform(-0.08, 0.12) * present[1]),
        lateral=float(rng.uniform(-0.06, 0.06) * present[2]) if lateral else 0.0,
        links=(
            float(rng.uniform(0.08, 0.3)),
            float(rng.uniform(0.08, 0.3)),
            float(rng.uniform(0.05, 0.3)),
        ),
        bearings=(float(low), float(middle), float(high)),
        roll_offset=float(rng.uniform(-0.05, 0.05) * present[3]),
        signs=(one, two, three, four, five),
    )


def random_pose(rng: np.random.Generator, spread: float) -> FloatArray:
    return se3.from_rotation_translation(
        so3.exp(rng.normal(size=3) * 2.0), spread * rng.normal(size=3)
    )


def member(offsets: Offsets, T_S_base: FloatArray, T_foot_tool: FloatArray) -> Chain:
    """Return the chain with axis 1 along z of {base} and the arm's plane at its x at q = 0.

    ``T_foot_tool`` is the tool frame relative to the foot of its point on the roll axis, with x
    along that axis. The limits are one turn wide.
    """

    def along(length: float, angle: float) -> FloatArray:
        return length * np.array([math.cos(angle), 0.0, math.sin(angle)])

    one, two, roll = offsets.bearings
    l1, l2, l3 = offsets.links
    shoulder = np.array([offsets.radial, offsets.lateral, 0.0])
    elbow = shoulder + along(l1, one)
    wrist = elbow + along(l2, two)
    foot = wrist + along(l3, roll) + along(offsets.roll_offset, roll + math.pi / 2.0)
    y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    # Any point on axis 1 or 2 will do.
    lines = [
        (z, 0.3 * z),
        (y, shoulder - 0.2 * y),
        (y, elbow),
        (y, wrist),
        (along(1.0, roll), foot),
    ]
    S = np.column_stack(
        [
            screws.revolute(sign * omega, r)
            for sign, (omega, r) in zip(offsets.signs, lines, strict=True)
        ]
    )
    T_base_foot = se3.from_rotation_translation(so3.rotation_y(-roll), foot)
    return Chain(
        M=T_S_base @ T_base_foot @ T_foot_tool,
        S=screws.moved(T_S_base, S),
        lower=np.full(5, -math.pi),
        upper=np.full(5, math.pi),
        speed=np.ones(5),
        names=("one", "two", "three", "four", "five"),
    )


def random_member(rng: np.random.Generator, *, lateral: bool = True) -> tuple[Chain, Offsets]:
    """Return a member with {S} anywhere and the tool in any orientation on its roll axis."""
    offsets = random_offsets(rng, lateral=lateral)
    turned = se3.from_rotation_translation(so3.exp(rng.normal(size=3)), np.zeros(3))
    return member(offsets, random_pose(rng, 0.5), turned), offsets


def limited_member(rng: np.random.Generator, *, lateral: bool = True) -> Chain:
    """Return a member with limits of random width and place."""
    chain, _ = random_member(rng, lateral=lateral)
    middle, half = rng.uniform(-1.5, 1.5, 5), rng.uniform(0.4, 2.4, 5)
    return dataclasses.replace(chain, lower=middle - half, upper=middle + half)


def arms(rng: np.random.Generator, number: int, *, lateral: bool = True) -> Iterator[Chain]:
    """Yield the Katana450, and then a ``number`` of random members."""
    yield katana()
    for _ in range(number):
        yield random_member(rng, lateral=lateral)[0]
