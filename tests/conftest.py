"""Fixtures of many tests: the arm of the URDF, and a session of it."""

from __future__ import annotations

import asyncio
import atexit
import gc
import inspect
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from typing import Any

import hypothesis
import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.settings import Settings
from tests.browser.server import AppServer
from tests.schedule import Completeness, LowestPriority, Schedule

LONG = "KATANA450_LONG" in os.environ
MANY_DRAGS = int(os.environ.get("KATANA450_DRAGS", "500"))
"""Number of random drags of each arm in the long tests; 10,000 of all arms take five hours."""

# A machine that others keep busy delays single examples.
hypothesis.settings.register_profile("katana450", deadline=None)
hypothesis.settings.load_profile("katana450")


def pytest_configure(config: pytest.Config) -> None:
    """Prepare each process that runs or distributes tests."""
    # What is collected is kept: to look through it for garbage takes a quarter of the collection.
    gc.disable()
    in_worker = hasattr(config, "workerinput")
    config.pluginmanager.register(LowestPriority() if in_worker else Completeness())
    # A shell has what it runs in the background ignore Ctrl-C, and so would all it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Servers that the tests start open no browser.
    os.environ.pop("BROWSER", None)
    # They keep their event logs out of the user's folders.
    state = tempfile.mkdtemp(prefix="katana450-")
    os.environ["XDG_STATE_HOME"] = state
    atexit.register(shutil.rmtree, state, ignore_errors=True)


def pytest_report_header() -> str:
    """Report which tests are left out."""
    return "every test with all its cases" if LONG else "without what is left to `make test-long`"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect what is long, and all but some cases of a test, unless all tests are requested."""
    left_out = set() if LONG else _long(items)
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
        items[:] = [item for item in items if item not in left_out]


def _long(items: list[pytest.Item]) -> set[pytest.Item]:
    """Return the items that `make test` leaves out.

    Of a test with the marker ``cases(n)`` it runs n cases, spread evenly over those that are not
    long by themselves.
    """
    left_out = {item for item in items if item.get_closest_marker("long")}
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item not in left_out and item.get_closest_marker("cases"):
            tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for cases in tests.values():
        marker = cases[0].get_closest_marker("cases")
        number = min(marker.args[0], len(cases)) if marker is not None else len(cases)
        chosen = {cases[len(cases) * place // number] for place in range(number)}
        left_out.update(set(cases) - chosen)
    return left_out


def pytest_collection_finish() -> None:
    """Look for garbage again, but never among the tests."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test that is a coroutine, in the loop of its server if that is in this process."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj) or pyfuncitem.get_closest_marker("anyio"):
        return None
    names = inspect.signature(pyfuncitem.obj).parameters
    arguments: dict[str, Any] = {
        name: value for name, value in pyfuncitem.funcargs.items() if name in names
    }
    server = arguments.get("local") or arguments.get("guarded")
    (server.run if server else asyncio.run)(pyfuncitem.obj(**arguments))
    return True


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Schedule:
    """Return the schedule by which `make test` runs the tests in several processes."""
    return Schedule(config, log)


@pytest.fixture(scope="module")
def plain_server() -> Iterator[AppServer]:
    """Return a server for all tests of a module, each of which finds it as the last one left it."""
    with AppServer() as server:
        yield server


@pytest.fixture(scope="session")
def robot() -> Robot:
    """The robot of the URDF file."""
    return load()


@pytest.fixture(scope="session")
def arm(robot: Robot) -> MountedArm:
    """Its arm."""
    return robot.require_arm()


@pytest.fixture
def session(arm: ArmModel) -> Session:
    """A session of it with the app's own ready posture."""
    return Session(arm, np.array(Settings().ready))


@pytest.fixture
def state(session: Session) -> State:
    """The arm at rest in its ready posture."""
    return session.begin(session.ready, 0.0, 0.0)
