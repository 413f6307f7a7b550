"""Margins of the arm to its boundaries, compared with a separate count of each."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.findings import margins
from katana450.maths.kinematics.forward import jacobian_body
from katana450.maths.kinematics.velocity import characteristic_length


@pytest.fixture(scope="module")
def session(shipped: Session) -> Session:
    return shipped


@pytest.mark.parametrize("seed", range(6))
def test_each_margin_is_the_minimum(session: Session, seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = session.require_arm().chain
    q = rng.uniform(chain.lower, chain.upper)
    x = np.append(
        q, rng.uniform(session.require_arm().gripper.lower, session.require_arm().gripper.upper)
    )
    world = session.world_at(session.begin(session.ready, 0.0, 0.0))
    assert world is not None
    reported = margins(chain, world, x)

    rooms = [min(a - low, up - a) for a, low, up in zip(q, chain.lower, chain.upper, strict=True)]
    assert reported.limits.tolist() == rooms
    assert rooms[reported.axis] == min(rooms)

    # Its square is the least eigenvalue of J^T J, in units of the characteristic length.
    J = jacobian_body(chain, q)
    scaled = np.vstack((J[:3], J[3:] / characteristic_length(chain)))
    least = float(np.linalg.eigvalsh(scaled.T @ scaled)[0])
    assert reported.singular_values[-1] ** 2 == pytest.approx(least, abs=1e-12)

    assert reported.nearest is not None
    names = [part.name for part in world.parts]
    gaps = {pair: world.gap(x, *pair) for pair in combinations(names, 2)}
    assert reported.nearest.distance == pytest.approx(min(gaps.values()), abs=1e-9)
    assert gaps[reported.nearest.parts] == pytest.approx(reported.nearest.distance, abs=1e-9)


def test_margin_is_negative_beyond_a_limit(session: Session) -> None:
    chain = session.require_arm().chain
    q = np.array(session.ready)
    q[3] = chain.upper[3] + 0.01
    reported = margins(chain, None, np.append(q, 0.0))
    assert (reported.axis, reported.nearest) == (3, None)
    assert reported.limits[3] == pytest.approx(-0.01)
