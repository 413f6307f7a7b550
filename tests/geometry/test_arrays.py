from __future__ import annotations

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.geometry.arrays import finite_array, frozen


def test_finite_array_copies_and_converts() -> None:
    source = np.array([1, 2, 3])
    got = finite_array(source, (3,), "The list")
    assert got.dtype == np.float64
    source[0] = 9
    np.testing.assert_array_equal(got, [1.0, 2.0, 3.0])


def test_error_names_array_place_and_value() -> None:
    with pytest.raises(InputError, match=r"The list has -inf at \[1\]"):
        finite_array([0.0, -np.inf], (2,), "The list")


def test_frozen_copies_and_cannot_be_written() -> None:
    source = np.zeros(2)
    got = frozen(source)
    source[0] = 1.0
    assert got[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        got[0] = 1.0
