"""Tests of the data in the figures of a report."""

from __future__ import annotations

import numpy as np

from katana450.extensions.media.figures import PARTS, largest
from katana450.extensions.media.measures import PathTrace


def test_the_drawn_error_is_the_largest_of_every_part_of_every_path() -> None:
    rng = np.random.default_rng(3)
    sigma = np.linspace(0.0, 1.0, 2001)
    off = rng.normal(size=(3, 2001, 3))
    still = np.zeros((2001, 3))
    paths = [PathTrace("line", sigma, still, error, np.zeros(2001)) for error in off]
    middles, drawn = largest(paths)
    errors = np.linalg.norm(off, axis=2).max(axis=0)
    half = 0.5 / PARTS
    for middle, most in zip(middles, drawn, strict=True):
        near = np.abs(sigma - middle)
        assert errors[near < half - 1e-9].max() <= most <= errors[near < half + 1e-9].max()
    assert drawn.max() == errors.max()
