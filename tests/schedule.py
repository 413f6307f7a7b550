"""Schedule of the tests when several processes run them.

Tests that drive a browser would starve each other of time, so they run in one process. Those that
run servers mostly wait, and run in two. The others only compute. They run file by file, at the
lowest priority, in the time that is left.

The processes are forks of the one that collected the tests, so that modules are loaded once.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path, PurePath
from typing import NoReturn

import pytest
from _pytest.capture import FDCapture

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
    "tests/recording/test_default_folder.py": BROWSER,
    "tests/recording/test_episodes_on_a_server.py": SERVERS[1],
    "tests/recording/test_recording_jobs.py": BROWSER,
    "tests/recording/test_recorder.py": SERVERS[0],
    "tests/recording/test_recorder_in_trouble.py": BROWSER,
    "tests/recording/test_run_again_on_a_server.py": SERVERS[0],
    "tests/robot/test_other_arms.py": SERVERS[1],
    "tests/api/test_descriptions.py": SERVERS[1],
    "tests/rosbridge": SERVERS[1],
    "tests/control/test_transitions.py": EARLY,
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


def queue_of(items: list[pytest.Item]) -> list[list[int]]:
    """Return the indices of ``items`` by kind: first those that mostly wait, then many tests."""
    kinds: dict[str, list[int]] = {}
    for index, item in enumerate(items):
        kinds.setdefault(kind_of(item.nodeid), []).append(index)
    first = [kinds.pop(kind) for kind in (*SERVERS, BROWSER, EARLY) if kind in kinds]
    return first + sorted(kinds.values(), key=len, reverse=True)


class Distribution:
    """Plugin that runs the tests of one kind in one process, in several processes at once.

    Args:
        number: of the processes. On Windows, which has no forks, there is one.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        self._unfinished = 0

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool | None:
        """Run the tests; return None where pytest itself has to do it."""
        if sys.platform == "win32" or session.testsfailed or session.config.option.collectonly:
            return None
        self._unfinished = len(session.items)
        # The processes share the folder of temporary files, with other folders in it.
        session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
        # What is collected is garbage in none of them.
        gc.freeze()
        processes: dict[Connection, int] = {}
        try:
            for place in range(min(self._number, len(session.items))):
                ours, theirs = Pipe()
                process = os.fork()
                if process == 0:
                    for connection in (*processes, ours):
                        connection.close()
                    run_and_exit(session, theirs, place)
                theirs.close()
                processes[ours] = process
            self._serve(session, processes)
        finally:
            for process in processes.values():
                os.kill(process, signal.SIGINT)
            for process in processes.values():
                os.waitpid(process, 0)
        return True

    def _serve(self, session: pytest.Session, processes: dict[Connection, int]) -> None:
        """Give ``processes`` their tests and report the results, until all of them have ended."""
        hook = session.config.hook
        kinds = queue_of(session.items)
        running: dict[Connection, str] = {}
        while processes:
            for connection in wait(list(processes)):
                assert isinstance(connection, Connection)
                try:
                    word, value = connection.recv()
                except EOFError:
                    _, status = os.waitpid(processes.pop(connection), 0)
                    if status:
                        print(f"\nA process ended with {status} in {running.get(connection)}.")
                    continue
                if word == "next":
                    stopped = session.shouldfail or session.shouldstop
                    connection.send([] if stopped or not kinds else kinds.pop(0))
                elif word == "start":
                    running[connection] = session.items[value].nodeid
                elif word == "report":
                    report = hook.pytest_report_from_serializable(config=session.config, data=value)
                    hook.pytest_runtest_logreport(report=report)
                else:
                    self._unfinished -= 1
        if session.shouldfail:
            raise session.Failed(session.shouldfail)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Fail with another status than that of failed tests, which are tried again.

        A process that crashes leaves tests that were never run.
        """
        if self._unfinished and session.exitstatus != pytest.ExitCode.INTERRUPTED:
            print(f"\n{self._unfinished} tests were not run.")
            session.exitstatus = pytest.ExitCode.INTERNAL_ERROR


class Reporter:
    """Plugin of a process that runs tests for others: it reports to the one that shows results."""

    def __init__(self, config: pytest.Config, connection: Connection) -> None:
        self._config = config
        self._connection = connection

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Send the report of a part of a test."""
        data = self._config.hook.pytest_report_to_serializable(config=self._config, report=report)
        self._connection.send(("report", data))


def run_and_exit(session: pytest.Session, connection: Connection, place: int) -> NoReturn:
    """Run the tests that ``connection`` names in this process, and end it."""
    config = session.config
    status = 1
    try:
        os.environ["XDG_STATE_HOME"] += f"/{place}"
        separate_captures(config)
        config.pluginmanager.unregister(name="terminalreporter")
        config.pluginmanager.register(Reporter(config, connection))
        config.pluginmanager.register(LowestPriority())
        indices = _indices(connection)
        index = next(indices, None)
        while index is not None:
            connection.send(("start", index))
            # Fixtures of the session stay for the next test, so it is asked for before this one.
            following = next(indices, None)
            config.hook.pytest_runtest_protocol(
                item=session.items[index],
                nextitem=None if following is None else session.items[following],
            )
            connection.send(("finish", index))
            index = following
        status = 0
    except Exception:
        traceback.print_exc()
    finally:
        # Without what other processes have to do at their exit.
        with suppress(BaseException):
            session._setupstate.teardown_exact(None)
        os._exit(status)


def separate_captures(config: pytest.Config) -> None:
    """Give this process files of its own for what tests print; a fork shares those of its parent.

    The objects stay: modules that were loaded before may hold them as their streams.
    """
    captures = config.pluginmanager.getplugin("capturemanager")._global_capturing
    for capture in (captures.out, captures.err):
        # With `-s` there is none, and with `--capture=sys` one in memory.
        if isinstance(capture, FDCapture):
            with tempfile.TemporaryFile() as file:
                os.dup2(file.fileno(), capture.tmpfile.fileno(), inheritable=False)


def _indices(connection: Connection) -> Iterator[int]:
    """Yield the indices of the tests for this process, kind by kind."""
    while True:
        connection.send(("next", None))
        indices = connection.recv()
        if not indices:
            return
        yield from indices


class LowestPriority:
    """Plugin of a process that runs tests for others: it gives way before it computes.

    A process can't raise its priority again. Browsers and servers keep theirs, as these kinds are
    given out first.
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
