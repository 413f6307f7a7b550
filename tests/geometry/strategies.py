"""Hypothesis strategies of rotations and motions, dense where formulas are fragile."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from katana450.maths.geometry.arrays import FloatArray

repeatable = settings(max_examples=80, derandomize=True, database=None)

# Angles near 0, near pi, and in between.
angles = st.one_of(
    st.floats(0.0, math.pi),
    st.floats(-12.0, -1.0).map(lambda e: 10.0**e),
    st.floats(-12.0, -1.0).map(lambda e: math.pi - 10.0**e),
    st.sampled_from([0.0, 5e-324, 1e-160, math.pi]),
)
coordinates = st.floats(-2.0, 2.0, allow_subnormal=False)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)


def _unit(v: tuple[float, float, float]) -> FloatArray:
    return np.array(v) / math.hypot(*v)


directions = (
    st.tuples(coordinates, coordinates, coordinates)
    .filter(lambda v: math.hypot(*v) > 1e-3)
    .map(_unit)
)
rotation_vectors = st.builds(lambda n, theta: n * theta, directions, angles)
twists = st.builds(lambda w, v: np.concatenate((w, v)), rotation_vectors, points)
