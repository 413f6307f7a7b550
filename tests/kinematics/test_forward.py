from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body, jacobian_space, joint_frames
from tests.geometry.strategies import exp

GOLDEN = Path(__file__).parents[1] / "golden" / "fk_reference.json"


def test_forward_agrees_with_the_manufacturer(chain: Chain) -> None:
    samples = json.loads(GOLDEN.read_text())["samples"]
    assert len(samples) == 24
    for sample in samples:
        error = forward(chain, sample["q"]) - sample["T"]
        assert np.abs(error[:3, 3]).max() < 1e-12
        assert np.abs(error[:3, :3]).max() < 1e-8


def test_forward_is_the_product_of_exponentials(chain: Chain, rng: np.random.Generator) -> None:
    for q in rng.uniform(-7.0, 7.0, size=(50, 5)):
        T, frames = np.eye(4), []
        for i in range(5):
            T = T @ exp(chain.S[:, i] * q[i])
            frames.append(T)
        np.testing.assert_allclose(forward(chain, q), T @ chain.M, atol=4e-15)
        np.testing.assert_allclose(joint_frames(chain, q), frames, atol=4e-15)


def test_forward_at_zero_is_the_home_configuration(chain: Chain) -> None:
    np.testing.assert_array_equal(forward(chain, np.zeros(5)), chain.M)


def _differences(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the (6, 5) body twists by central differences."""
    h = 1e-6
    columns = []
    for step in h * np.eye(5):
        before, after = forward(chain, q - step), forward(chain, q + step)
        columns.append(se3.log(se3.inverse(before) @ after) / (2.0 * h))
    return np.column_stack(columns)


def test_body_jacobian_is_the_derivative_of_forward(chain: Chain, rng: np.random.Generator) -> None:
    for q in rng.uniform(chain.lower, chain.upper, size=(20, 5)):
        np.testing.assert_allclose(jacobian_body(chain, q), _differences(chain, q), atol=1e-9)


def test_space_jacobian_is_the_body_jacobian_in_the_base_frame(
    chain: Chain, rng: np.random.Generator
) -> None:
    for q in rng.uniform(chain.lower, chain.upper, size=(20, 5)):
        expected = se3.adjoint(forward(chain, q)) @ jacobian_body(chain, q)
        np.testing.assert_allclose(jacobian_space(chain, q), expected, atol=1e-14)


def test_space_jacobian_at_zero_is_the_screw_axes(chain: Chain) -> None:
    np.testing.assert_array_equal(jacobian_space(chain, np.zeros(5)), chain.S)


@pytest.mark.parametrize("function", [forward, jacobian_space, jacobian_body])
def test_invalid_joint_vector_is_refused(chain: Chain, function: object) -> None:
    assert callable(function)
    with pytest.raises(InputError, match="axis 2"):
        function(chain, [0.0, np.nan, 0.0, 0.0, 0.0])
