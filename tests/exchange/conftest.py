"""Mechanisms to be exported: the Katana450, and a tree that is nothing like it."""

from __future__ import annotations

from pathlib import Path

import pytest

from katana450.arm.robot.mechanism import Mechanism
from katana450.arm.robot.urdf_mechanism import load_mechanism
from katana450.resources import URDF_PATH

GANTRY = Path(__file__).parent / "gantry.urdf"

POSES = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.4, -1.187, 1.484, 0.14, 0.5, 0.2),
    (-1.1, -0.6, -0.9, 0.8, 1.2, -0.3),
)
"""Of the Katana, the gripper last."""

GANTRY_POSE = (0.3, 2.0, -0.6)


@pytest.fixture(scope="session")
def katana() -> Mechanism:
    return load_mechanism(URDF_PATH)[0]


@pytest.fixture(scope="session")
def gantry() -> Mechanism:
    return load_mechanism(GANTRY)[0]
