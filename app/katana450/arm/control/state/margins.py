"""Distances of the arm from its boundaries: joint limits, singularities and contacts."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.velocity import (
    limit_distances,
    nearest_limit,
    singular_values,
)


@dataclass(frozen=True, eq=False)
class Margins:
    """Distances of one posture from its boundaries.

    Attributes:
        limits: (n,) the distance of each axis to its nearer limit [rad]; negative beyond it.
        axis: the axis nearest to one of its limits, counted from 0, of those that turn.
        singular_values: (n,) those of the Jacobian over the characteristic length [1], in falling
            order.
        nearest: the nearest pair of parts; None if contacts are not checked.
    """

    limits: FloatArray
    axis: int
    singular_values: FloatArray
    nearest: Contact | None


def margins(chain: Chain, world: CollisionWorld | None, x: FloatArray) -> Margins:
    """Return the margins of one posture.

    Args:
        chain: the chain, which ends in the tool.
        world: the collision world; None to check no contacts.
        x: (n + 1,) the joints and the finger joint [rad].
    """
    q = x[: chain.n]
    nearest = None if world is None else world.nearest(x)
    limits = limit_distances(chain, q)
    return Margins(limits, nearest_limit(chain, limits), singular_values(chain, q), nearest)
