"""A map computed by a real scheduler and several worker processes on this machine."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.cli.main import main
from katana450.errors import ConfigurationError
from katana450.extensions.reachability import cluster
from katana450.extensions.reachability import map as map_module
from katana450.extensions.reachability.map import Survey
from katana450.extensions.reachability.reachability import Reachability

ROOT = Path(__file__).resolve().parents[2]
WORKERS = 2
MAP = ("--voxel", "150", "--pitches", "4", "--rolls", "4", "--samples", "30", "--seed", "2")

# When distributed is closed, it leaves sockets to the garbage collector.
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")


class Processes:
    """Dask processes of a test; all are stopped at its end."""

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self._stack, self._folder = stack, folder

    def scheduler(self) -> tuple[subprocess.Popen[str], str]:
        """Start a new scheduler; return it and its address."""
        process, (address,) = self._start(
            "distributed.cli.dask_scheduler", "--port", "0", wait_for=[r"Scheduler at:\s+(tcp\S+)"]
        )
        return process, address

    def workers(self, address: str, count: int) -> None:
        """Start worker processes of the scheduler at ``address``."""
        self._start(
            "distributed.cli.dask_worker",
            *(address, "--nworkers", str(count), "--nthreads", "1"),
            wait_for=[r"Registered to:\s+(tcp\S+)"] * count,
        )

    def _start(
        self, module: str, *options: str, wait_for: list[str]
    ) -> tuple[subprocess.Popen[str], list[str]]:
        """Start ``python -m module`` and wait for matching lines; return their first groups too."""
        process = self._stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-m", module, "--host", "127.0.0.1", "--no-dashboard", *options],
                stderr=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                text=True,
                cwd=ROOT,
                env=os.environ | {"DASK_TEMPORARY_DIRECTORY": str(self._folder)},
            )
        )
        self._stack.callback(process.terminate)
        assert process.stderr is not None
        groups: list[str] = []
        for line in process.stderr:
            found = re.search(wait_for[len(groups)], line)
            if found:
                groups.append(found.group(1))
            if len(groups) == len(wait_for):
                return process, groups
        raise AssertionError(f"{module} ended before it was ready")


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    with ExitStack() as stack:
        yield Processes(stack, tmp_path_factory.mktemp("dask"))


@pytest.fixture(scope="module")
def scheduler(processes: Processes) -> tuple[subprocess.Popen[str], str]:
    """Start a scheduler with its workers; return it and its address."""
    process, address = processes.scheduler()
    processes.workers(address, WORKERS)
    return process, address


@pytest.fixture(scope="module")
def address(scheduler: tuple[subprocess.Popen[str], str]) -> str:
    return scheduler[1]


@pytest.mark.long
def test_a_cluster_gives_the_bytes_of_one_machine(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, there = tmp_path / "here.npz", tmp_path / "there.npz"
    assert main(["workspace", *MAP, "--out", str(here)]) == 0
    # Many small chunks, so that there is work for every worker.
    monkeypatch.setattr(map_module, "POSES", 100)
    assert main(["workspace", *MAP, "--out", str(there), "--scheduler", address]) == 0
    assert here.read_bytes() == there.read_bytes()
    connect: Any = distributed.Client
    with connect(address, set_as_default=False) as client:
        transitions = client.run(lambda dask_worker: dask_worker.state.transition_counter)
    assert len(transitions) == WORKERS
    assert all(count > 0 for count in transitions.values())


def test_workers_of_another_version_are_refused(
    address: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cluster, "version", lambda: "0.0.0")
    assert main(["workspace", *MAP, "--scheduler", address]) == 1
    printed = capsys.readouterr()
    assert re.search(r"worker tcp\S+ has katana450 \S+, but this machine 0\.0\.0", printed.err)
    assert printed.out == ""


def test_workers_without_katana450_are_refused(
    address: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    here = os.getpid()

    def missing_elsewhere() -> dict[str, str]:
        if os.getpid() != here:
            raise ModuleNotFoundError("No module named 'app'")
        return {}

    monkeypatch.setattr(cluster, "_fingerprint", missing_elsewhere)
    assert main(["workspace", *MAP, "--scheduler", address]) == 1
    assert "cannot run katana450: No module named 'app'" in capsys.readouterr().err


def test_scheduler_without_workers_is_reported(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 1.0)
    _, address = processes.scheduler()
    with (
        pytest.raises(ConfigurationError, match="has no workers"),
        cluster.connect_cluster(address),
    ):
        pass


def test_dead_scheduler_is_reported(
    scheduler: tuple[subprocess.Popen[str], str], arm: MountedArm
) -> None:
    """Kill the scheduler; this must be the last test of the file."""
    process, address = scheduler
    reachability = Reachability(arm.chain, arm.T_base_shoulder, 0.0, 4, 4)
    survey = Survey(reachability, voxel=0.05, samples=0, seed=0)
    chunks = survey.grid.chunks(50)
    with cluster.connect_cluster(address) as connection:
        arriving = connection.counts(survey, chunks)
        number, counts = next(arriving)
        assert np.array_equal(counts, survey.count(chunks[number]))
        process.kill()
        with pytest.raises(ConfigurationError, match=f"The cluster at {address} could not finish"):
            list(arriving)
