"""Postures at and near every singularity of an arm, found without code of the solvers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from katana450.maths.geometry import screws
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space

BESIDE = 10
"""Number of postures for each point of a surface, of which all but the first are beside it."""

Function = Callable[[FloatArray], float]


def determinant(chain: Chain) -> Function:
    """Return the function that is zero where six axes are singular, of whatever kind."""
    return lambda q: float(np.linalg.det(jacobian_space(chain, q)))


def _points(chain: Chain, q: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
    S = jacobian_space(chain, q)
    return S, [screws.point_on(axis) for axis in S.T]


def elbow(chain: Chain) -> Function:
    """Return the function that is zero where axes 2, 3 and 4 lie in one plane."""

    def area(q: FloatArray) -> float:
        S, points = _points(chain, q)
        return float(S[:3, 1] @ np.cross(points[2] - points[1], points[3] - points[2]))

    return area


def shoulder(chain: Chain) -> Function:
    """Return the function that is zero where the tool point is beside axis 1 along axis 2."""

    def ahead(q: FloatArray) -> float:
        S, points = _points(chain, q)
        tool = forward(chain, q)[:3, 3]
        return float(np.cross(S[:3, 0], S[:3, 1]) @ (tool - points[0]))

    return ahead


def on_surface(chain: Chain, function: Function, rng: np.random.Generator) -> FloatArray:
    """Return a posture inside the limits where ``function`` is zero, to the last bit."""
    while True:
        a, b = rng.uniform(chain.lower, chain.upper, (2, chain.n))
        if function(a) * function(b) < 0.0:
            break
    for _ in range(80):
        middle = 0.5 * (a + b)
        if function(a) * function(middle) <= 0.0:
            b = middle
        else:
            a = middle
    posture: FloatArray = a
    return posture


def near_surface(
    chain: Chain, function: Function, rng: np.random.Generator, count: int
) -> FloatArray:
    """Return postures (count, n) on the surface or 1e-16 to 0.1 rad beside it."""
    postures = []
    for number in range(count):
        if number % BESIDE == 0:
            q = on_surface(chain, function, rng)
            postures.append(q)
        else:
            step = rng.normal(size=chain.n)
            off = 10.0 ** rng.uniform(-16.0, -1.0)
            postures.append(chain.clamp(q + off * step / np.linalg.norm(step)))
    return np.array(postures)


def aligned_wrist(
    chain: Chain, rng: np.random.Generator, count: int, joint: int, angles: tuple[float, ...]
) -> FloatArray:
    """Return postures (count, n) with a joint at or near an angle that lines up its neighbours."""
    q = rng.uniform(chain.lower, chain.upper, (count, chain.n))
    off = 10.0 ** rng.uniform(-16.0, -1.0, count) * rng.choice((-1.0, 0.0, 1.0), count)
    q[:, joint] = rng.choice(angles, count) + off
    return np.clip(q, chain.lower, chain.upper)
