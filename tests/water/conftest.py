"""The cup, the basin and the table of the experiment."""

from __future__ import annotations

import pytest

from katana450.arm.robot.props import load_props
from katana450.arm.robot.water import around_of
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import Flow


@pytest.fixture(scope="session")
def around() -> WaterEnvironment:
    return around_of(load_props())


@pytest.fixture(scope="session")
def flow(around: WaterEnvironment) -> Flow:
    return Flow(around)
