"""The cup, the basin and the table of the experiment."""

from __future__ import annotations

import pytest

from katana450.arm.robot.props import load_props, water_environment
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import WaterFlow
from tests.view.conftest import server

__all__ = ["server"]


@pytest.fixture(scope="session")
def environment() -> WaterEnvironment:
    return water_environment(load_props())


@pytest.fixture(scope="session")
def flow(environment: WaterEnvironment) -> WaterFlow:
    return WaterFlow(environment)
