"""URDF files of arms of other kinds, made from their published dimensions."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tests.robot.public_arms import PX100, PX150, QUARTER, UR5, VX300S, J, X, Y, written
from tests.view.conftest import server

__all__ = ["server"]

TWISTED = [
    J("one", "revolute", "base", "l1", (0.0, 0.0, 0.1)),
    J("two", "revolute", "l1", "l2", (0.02, 0.0, 0.1), (0.4, 0.0, 0.0), Y),
    J("three", "revolute", "l2", "l3", (0.2, 0.01, 0.0), (0.2, 0.3, 0.0), Y),
    J("four", "revolute", "l3", "l4", (0.2, 0.0, 0.0), (0.0, 0.2, 0.0), Y),
    J("five", "revolute", "l4", "l5", (0.05, 0.01, 0.0), (0.1, 0.0, 0.3), X),
    J("tip_joint", "fixed", "l5", "tip_of_it", (0.1, 0.0, 0.02)),
]
"""Five axes that are no member of the family."""

SEVEN = [
    J("j1", "revolute", "base", "l1", (0.0, 0.0, 0.34)),
    J("j2", "revolute", "l1", "l2", rpy=(-QUARTER, 0.0, 0.0)),
    J("j3", "revolute", "l2", "l3", (0.0, -0.4, 0.0), (QUARTER, 0.0, 0.0)),
    J("j4", "revolute", "l3", "l4", rpy=(QUARTER, 0.0, 0.0)),
    J("j5", "revolute", "l4", "l5", (0.0, 0.4, 0.0), (-QUARTER, 0.0, 0.0)),
    J("j6", "revolute", "l5", "l6", rpy=(-QUARTER, 0.0, 0.0)),
    J("j7", "revolute", "l6", "l7", rpy=(QUARTER, 0.0, 0.0)),
    J("flange_joint", "fixed", "l7", "flange", (0.0, 0.0, 0.126)),
    J("tcp_joint", "fixed", "flange", "tcp", (0.02, 0.0, 0.1)),
]

FILES = {
    "px100": PX100,
    "px150": PX150,
    "vx300s": VX300S,
    "ur5": UR5,
    "twisted": TWISTED,
    "seven": SEVEN,
}


@pytest.fixture(scope="session")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that writes a file of FILES and returns its path."""
    folder = tmp_path_factory.mktemp("urdf")
    return cache(lambda name: written(folder, name, FILES[name]))
