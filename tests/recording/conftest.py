"""Fixtures of the tests of recordings."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.episodes import running_episode
from tests.browser.server import RECORDING_APP, AppServer
from tests.recording.episode_bench import Bench
from tests.recording.recorded import record


@pytest.fixture(scope="session")
def recorded_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[TickRecord]]:
    path = tmp_path_factory.mktemp("recorded") / "run.mcap"
    return path, record(path, 250, 5)


@pytest.fixture(scope="session")
def run(recorded_run: tuple[Path, list[TickRecord]]) -> Path:
    """Return the recording of a random session, which no test changes."""
    return recorded_run[0]


@pytest.fixture(scope="session")
def records(recorded_run: tuple[Path, list[TickRecord]]) -> list[TickRecord]:
    """Return the records of that session."""
    return recorded_run[1]


@pytest.fixture(scope="package")
def server_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the shared server: its ring, its episodes and temporary files."""
    return tmp_path_factory.mktemp("server")


@pytest.fixture(scope="package")
def shared_server(server_folder: Path) -> Iterator[AppServer]:
    """Return a server for several modules, which begin with what those before them recorded.

    Its start takes 2 s of processor time, and recording begins 5 s later.
    """
    temporary = server_folder / "temporary"
    temporary.mkdir()
    places = (
        "--record",
        str(server_folder / "ring"),
        "--episodes",
        str(server_folder / "episodes"),
    )
    # A busy machine delays the heartbeats of its processes, for which the arm would pause.
    command = (*RECORDING_APP, "--silence", "2.0", *places)
    with AppServer(command, environment={**os.environ, "TMPDIR": str(temporary)}) as running:
        yield running


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """Return a ring with a keeper of episodes, which does not wait for late records."""
    monkeypatch.setattr(running_episode, "LATE_SECONDS", 0.0)
    bench = Bench(tmp_path)
    yield bench
    bench.keeper.close()
    bench.ring.close()
