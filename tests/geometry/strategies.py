"""Hypothesis strategies of rotations and motions, dense where formulas are fragile; motions."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from hypothesis import settings
from hypothesis import strategies as st

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from tests.conftest import LONG

repeatable = settings(max_examples=80 if LONG else 40, derandomize=True, database=None)

# Angles near 0, near pi, and in between.
angles = st.one_of(
    st.floats(0.0, math.pi),
    st.floats(-12.0, -1.0).map(lambda e: 10.0**e),
    st.floats(-12.0, -1.0).map(lambda e: math.pi - 10.0**e),
    st.sampled_from([0.0, 5e-324, 1e-160, math.pi]),
)
coordinates = st.floats(-2.0, 2.0, allow_subnormal=False)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)


directions = (
    st.tuples(coordinates, coordinates, coordinates)
    .filter(lambda v: math.hypot(*v) > 1e-3)
    .map(lambda v: np.array(v) / math.hypot(*v))
)
rotation_vectors = st.builds(lambda n, theta: n * theta, directions, angles)
twists = st.builds(lambda w, v: np.concatenate((w, v)), rotation_vectors, points)


def exp(V: npt.ArrayLike) -> FloatArray:
    """Return the motion along the twist V = (omega, v) (6,) for unit time.

    For a screw axis S, exp(S q) is the motion by the angle q. The coefficient of hat(omega)^2 loses
    digits near 0 only as fast as hat(omega)^2 itself vanishes, so no series is needed.
    """
    V = np.asarray(V, dtype=np.float64)
    w, v = V[:3], V[3:]
    theta = math.hypot(*w)
    a = so3.sinc(theta)
    b = 0.5 * so3.sinc(0.5 * theta) ** 2
    square = theta * theta
    c = (1.0 - a) / square if square else 1.0 / 6.0
    W = so3.hat(w)
    Wv = W @ v
    return se3.from_rotation_translation(so3.exp(w), v + b * Wv + c * (W @ Wv))
