"""Schedule of the tests when several processes run them.

Tests that drive a browser would starve each other of time, so they run in one process. Those that
run servers mostly wait, and run in two. The others only compute. They run file by file, at the
lowest priority, in the time that is left.
"""

from __future__ import annotations

import os
import sys
from collections import OrderedDict
from contextlib import suppress
from functools import cache
from pathlib import Path, PurePath
from typing import Any

import pytest
from xdist.scheduler.loadscope import LoadScopeScheduling

ROOT = Path(__file__).resolve().parents[1]

BROWSER = "browser"
SERVERS = ("servers, first half", "servers, second half")
EARLY = "computes for long, so that nothing else would be left beside it at the end"

KINDS = {
    "tests/browser": BROWSER,
    # These run servers too, or control loops on the clock of the machine. They are distributed so
    # that the rows are about equally long.
    "tests/event_log": SERVERS[1],
    "tests/extensions": SERVERS[0],
    "tests/runtime": SERVERS[1],
    "tests/cli/test_lines.py": SERVERS[1],
    "tests/cli/test_live.py": SERVERS[1],
    "tests/cli/test_serve.py": BROWSER,
    "tests/docs/test_code_blocks.py": SERVERS[0],
    "tests/examples": SERVERS[1],
    "tests/leader/test_leader_on_a_server.py": SERVERS[0],
    "tests/leader/test_leader_run.py": SERVERS[1],
    "tests/library/test_run.py": SERVERS[1],
    "tests/real_arm/test_arm_commands.py": SERVERS[0],
    "tests/real_arm/test_driver.py": SERVERS[1],
    "tests/real_arm/test_driver_with_emulator.py": SERVERS[0],
    "tests/real_arm/test_session_with_driver.py": SERVERS[1],
    "tests/real_arm/test_emulator_process.py": SERVERS[0],
    "tests/recording/test_attached_scripts.py": SERVERS[1],
    "tests/recording/test_episodes_on_a_server.py": SERVERS[0],
    "tests/recording/test_recording_jobs.py": SERVERS[1],
    "tests/recording/test_recorder.py": SERVERS[0],
    "tests/recording/test_run_again_on_a_server.py": SERVERS[1],
    "tests/rosbridge": SERVERS[1],
    # The most tests come first, so a file of many takes the single test of the types along.
    "tests/control/test_transitions.py": EARLY,
    "tests/packaging/test_types.py": EARLY,
}
"""Kinds of the tests that need their time at once, or early, by their folders and files."""

GATEWAY = PurePath("tests/gateway")
SECOND_HALF = "test_m"
"""Name from which on the files of this folder belong to the second half."""

IN_PROCESS = "tests/gateway, in one process"
"""Kind of the tests of this folder that start no server. Together they make one robot."""


def kind_of(nodeid: str) -> str:
    """Return the kind of a test: browser, servers, or the file of a test that only computes."""
    path = PurePath(nodeid.partition("::")[0])
    if path.parent == GATEWAY:
        return SERVERS[path.name >= SECOND_HALF] if starts_servers(path) else IN_PROCESS
    for place in (path, *path.parents):
        if place.as_posix() in KINDS:
            return KINDS[place.as_posix()]
    return path.as_posix()


@cache
def starts_servers(path: PurePath) -> bool:
    """Return whether the file of tests at ``path`` uses a server in other processes."""
    text = (ROOT / path).read_text(encoding="utf-8")
    return any(word in text for word in ("AppServer", "Site", "aconnect"))


class Queue(OrderedDict[str, Any]):
    """Kinds of tests that wait for a process: those that mostly wait come first."""

    def popitem(self, last: bool = True) -> tuple[str, Any]:
        """Remove the kind that is given out next, and return it with its tests."""
        for kind in (*SERVERS, BROWSER, EARLY):
            if kind in self:
                return kind, self.pop(kind)
        return super().popitem(last)


class Schedule(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
    """The tests of one kind run in one process; after browser and servers those with the most."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.workqueue: OrderedDict[str, Any] = Queue()

    def _split_scope(self, nodeid: str) -> str:
        return kind_of(nodeid)


class Completeness:
    """Plugin of the process that distributes the tests: it reports tests that were never run."""

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Fail with another status than that of failed tests, which are tried again.

        xdist ends early with the status of failed tests if its processes crash repeatedly.
        """
        distribution = session.config.pluginmanager.getplugin("dsession")
        if distribution is None:
            return
        schedule = distribution.sched
        if schedule is None or schedule.collection is None or schedule.has_pending:
            print("\nSome tests were not run.")
            session.exitstatus = pytest.ExitCode.INTERNAL_ERROR


class LowestPriority:
    """Plugin of a process that runs tests for others: it gives way before it computes.

    A process can't raise its priority again. Browsers and servers keep theirs, as these kinds have
    the most tests and so are given out first.
    """

    def __init__(self) -> None:
        self._lowered = False

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Lower the priority of this process for good, before its first test that computes."""
        if self._lowered or kind_of(item.nodeid) in (BROWSER, *SERVERS):
            return
        self._lowered = True
        if sys.platform == "win32":
            return
        os.nice(19)
        # Linux shares a processor among sessions first, so the priority is that of a session.
        with suppress(OSError):
            os.setsid()
            with open("/proc/self/autogroup", "w", encoding="ascii") as group:
                group.write("19")
