"""Distances of the arm from its boundaries: joint limits, singularities and contacts."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.velocity import limit_distances, singular_values


@dataclass(frozen=True, eq=False)
class Margins:
    """Distances of one posture from its boundaries.

    Attributes:
        axis: the axis nearest to one of its limits, counted from 0.
        limit: the distance of that axis to the limit [rad]; negative beyond it.
        smallest_singular_value: of the Jacobian over the characteristic length [1].
        nearest: the nearest pair of parts; None if contacts are not checked.
    """

    axis: int
    limit: float
    smallest_singular_value: float
    nearest: Contact | None


def margins(chain: Chain, world: CollisionWorld | None, x: FloatArray) -> Margins:
    """Return the margins of one posture.

    Args:
        chain: the chain, which ends in the tool.
        world: the collision world; None to check no contacts.
        x: (n + 1,) the joints and the finger joint [rad].
    """
    q = x[: chain.n]
    distances = limit_distances(chain, q)
    axis = int(distances.argmin())
    return Margins(
        axis,
        float(distances[axis]),
        float(singular_values(chain, q)[-1]),
        None if world is None else world.nearest(x),
    )
