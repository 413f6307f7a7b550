"""The Katana450 from its published numbers, so that these tests need no robot description file."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.maths.geometry import screws
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain

L1, L2 = 0.190, 0.139
TOOL_LENGTHS = {"tcp": 0.3028, "flange": 0.1883}


def katana(tool: str = "tcp") -> Chain:
    """Return the arm with a tool point on its last axis, in the frame of the shoulder."""
    M = np.eye(4)
    M[0, 3] = L1 + L2 + TOOL_LENGTHS[tool]
    x, y, z = np.eye(3)
    axes = [(z, 0.0), (y, 0.0), (y, L1), (y, L1 + L2), (x, 0.0)]
    return Chain(
        M=M,
        S=np.column_stack([screws.revolute(omega, along * x) for omega, along in axes]),
        lower=np.radians([-173.35, -124.25, -117.70, -116.50, -164.50]),
        upper=np.radians([165.65, 7.75, 127.30, 107.50, 171.50]),
        speed=np.array([2.209, 1.191, 1.191, 2.209, 2.209]),
        names=("pan", "shoulder", "elbow", "wrist", "roll"),
    )


@pytest.fixture(scope="session")
def chain() -> Chain:
    return katana()


@pytest.fixture(scope="session")
def flange_chain() -> Chain:
    return katana("flange")


@pytest.fixture(scope="session")
def lengths() -> FloatArray:
    """l1, l2, l3 [m] of the default tool."""
    return np.array([L1, L2, TOOL_LENGTHS["tcp"]])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(450)
