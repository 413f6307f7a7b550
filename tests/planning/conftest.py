"""Paths that several tests use."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.extensions.programs.planning.curve_path import ToolPath
from katana450.extensions.programs.planning.curves import Linear, ToolArc, ToolLine, ToolLines
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch, branch_of
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.path import Path
from katana450.maths.planning.scaling import Bounds
from katana450.settings import Settings

FRONT_UP = Branch("front", "up")


@pytest.fixture(scope="session")
def ready() -> FloatArray:
    return np.array(Settings().ready)


@pytest.fixture(scope="session")
def bounds(arm: ArmModel) -> Bounds:
    return Bounds(arm.limits, 0.5)


@pytest.fixture(scope="session")
def circle() -> ToolArc:
    """The paper's circle: y^2 + (z + 110)^2 = 100^2, x = 150 mm, from its top, pitch 99 deg."""
    pitch, roll = Linear(math.radians(99.0), math.radians(99.0)), Linear(0.0, 0.0)
    top, centre, axis = np.array([[0.15, 0.0, -0.01], [0.15, 0.0, -0.11], [1.0, 0.0, 0.0]])
    return ToolArc(top, centre, axis, math.tau, pitch, roll)


def lines(start: ToolTarget) -> ToolLines:
    """Return lines round three sides of a frame beside `at`, and a turn on the spot."""
    steps = ((0.0, 0.0, 0.0), (0.0, -0.15, 0.0), (-0.05, -0.15, -0.1), (-0.05, 0.05, -0.1))
    vias = [ToolTarget(start.position + step, start.pitch, start.roll) for step in steps]
    last = vias[-1]
    vias += [ToolTarget(last.position, last.pitch + 0.2, last.roll + 1.0)]
    return ToolLines(tuple(vias), np.array([0.8, 0.3, 0.5]))


@pytest.fixture(scope="session")
def paths(arm: ArmModel, circle: ToolArc, ready: FloatArray) -> dict[str, Path]:
    """One path of each kind, by name."""
    chain = arm.chain
    start = ToolTarget.at(chain, ready)
    aside = start.position + np.array([-0.1, -0.2, -0.15])
    line = ToolLine(start, ToolTarget(aside, start.pitch + 0.3, start.roll + 1.0))
    pour = ToolLine(start, ToolTarget(start.position, start.pitch, start.roll + 1.6))
    vias = np.array(
        [[0.0, -1.0, 1.0, 0.0, 0.0], [1.0, -0.5, 0.5, 0.3, 0.0], [1.2, -1.5, 0.2, 0.3, 1.0]]
    )
    return {
        "circle": ToolPath(arm.chain_to("flange"), circle, FRONT_UP, np.zeros(5)),
        "line": ToolPath(chain, line, branch_of(chain, ready), ready),
        "pour": ToolPath(chain, pour, branch_of(chain, ready), ready),
        "lines": ToolPath(chain, lines(start), branch_of(chain, ready), ready),
        "joints": JointPath(chain, vias[:2]),
        "via": JointPath(chain, vias, np.array([0.8])),
    }
