"""How near the arm is to what it cannot pass: its limits, a singularity, other parts."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.velocity import limit_distances, singular_values


@dataclass(frozen=True, eq=False)
class Margins:
    """Of one posture.

    Attributes:
        axis: the one that is nearest to one of its limits, counted from 0.
        limit: how far that is [rad]; negative beyond it.
        smallest_singular_value: of the Jacobian over the characteristic length [1].
        nearest: of all the parts that may meet; None where nothing is looked at.
    """

    axis: int
    limit: float
    smallest_singular_value: float
    nearest: Contact | None


def margins(chain: Chain, world: CollisionWorld | None, x: FloatArray) -> Margins:
    """``x``: (n + 1,) the joints and the finger joint [rad]. ``chain`` ends in the tool."""
    q = x[: chain.n]
    distances = limit_distances(chain, q)
    axis = int(distances.argmin())
    return Margins(
        axis,
        float(distances[axis]),
        float(singular_values(chain, q)[-1]),
        None if world is None else world.nearest(x),
    )
