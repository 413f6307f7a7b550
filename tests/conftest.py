"""What many tests stand on: the arm of the URDF, and a session of it."""

from __future__ import annotations

import signal

import numpy as np
import pytest

from app.control.arm import Arm
from app.control.session import Session
from app.robot.model import RobotModel, load
from app.settings import Settings


def pytest_configure() -> None:
    """A shell has what it runs in the background ignore Ctrl-C, and so would all it starts."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def model() -> RobotModel:
    """The robot of the URDF file."""
    return load()


@pytest.fixture(scope="session")
def arm(model: RobotModel) -> Arm:
    """Its arm."""
    return model.arm


@pytest.fixture
def session(arm: Arm) -> Session:
    """A session of it with the app's own ready posture."""
    return Session(arm, np.array(Settings().ready))
