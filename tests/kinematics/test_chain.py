from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain


def test_arrays_are_copies_that_cannot_be_written(chain: Chain) -> None:
    lower = np.array(chain.lower)
    copy = dataclasses.replace(chain, lower=lower)
    lower[0] = 0.0
    assert copy.lower[0] == chain.lower[0]
    for array in (chain.M, chain.S, chain.lower, chain.upper, chain.speed):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_with_tool_changes_the_home_pose_alone(chain: Chain) -> None:
    M = np.array(chain.M)
    M[0, 3] = 0.5
    other = chain.with_tool(M)
    np.testing.assert_array_equal(other.M, M)
    np.testing.assert_array_equal(other.S, chain.S)
    assert other.names == chain.names


def _changed(array: FloatArray, index: tuple[int, ...], value: float) -> FloatArray:
    result = np.array(array)
    result[index] = value
    return result


def _broken(chain: Chain) -> list[tuple[dict[str, Any], str]]:
    return [
        ({"S": _changed(chain.S, (0, 4), 1.1)}, r"axis 5 \(roll\) has length 1.1"),
        ({"S": _changed(chain.S, (5, 0), 0.2)}, r"axis 1 \(pan\) advances by 0.2"),
        ({"S": chain.S[:, :4]}, r"screw axes S has shape \(6, 4\)"),
        ({"lower": chain.upper}, r"axis 1 \(pan\) are 2.89\d* to 2.89"),
        ({"upper": _changed(chain.upper, (1,), np.nan)}, "'upper' has nan"),
        ({"speed": _changed(chain.speed, (2,), 0.0)}, r"speed limit of axis 3 \(elbow\) is 0"),
        ({"M": 2.0 * np.eye(4)}, "home configuration M"),
        ({"names": ()}, "screw axes S has shape"),
    ]


def test_invalid_chain_is_refused_with_the_reason(chain: Chain) -> None:
    for change, words in _broken(chain):
        with pytest.raises(RobotDescriptionError, match=words):
            dataclasses.replace(chain, **change)


def test_a_chain_without_joints_is_refused() -> None:
    with pytest.raises(RobotDescriptionError, match="no joints"):
        Chain(np.eye(4), np.zeros((6, 0)), np.zeros(0), np.zeros(0), np.zeros(0), ())


def test_limits_hold_to_the_slack_and_no_farther(chain: Chain) -> None:
    at_limit = np.array(chain.upper)
    assert chain.within_limits(at_limit)
    assert chain.within_limits(chain.lower)
    over = at_limit + 1e-6 * np.eye(5)[2]
    assert not chain.within_limits(over)
    assert chain.within_limits(over, slack=2e-6)
    under = chain.lower - 1e-6 * np.eye(5)[4]
    assert not chain.within_limits(under)


def test_clamp_sets_each_axis_on_its_nearest_limit(chain: Chain) -> None:
    q = np.array([9.0, -9.0, 0.5, 9.0, -0.5])
    expected = [chain.upper[0], chain.lower[1], 0.5, chain.upper[3], -0.5]
    np.testing.assert_array_equal(chain.clamp(q), expected)


@pytest.mark.parametrize(
    ("q", "words"),
    [
        ([0, 0, np.nan, 0, 0], r"nan for axis 3 \(elbow\)"),
        ([0, 0, 0, 0, -np.inf], r"-inf for axis 5 \(roll\)"),
        ([0, 0, 0], r"shape \(3,\)"),
        (np.zeros((5, 1)), r"shape \(5, 1\)"),
        (["a"] * 5, "values"),
        (None, "values"),
        ([[0], [0, 1]], "regular"),
        (np.zeros(5, dtype=complex), "complex"),
    ],
)
def test_invalid_joint_vector_is_refused(chain: Chain, q: npt.ArrayLike, words: str) -> None:
    with pytest.raises(InputError, match=words):
        chain.check_q(q)


def test_check_q_copies_and_takes_integers(chain: Chain) -> None:
    got = chain.check_q([0, 1, 0, 1, 0])
    assert got.dtype == np.float64
    assert chain.check_q(got) is not got
