"""A server that is ended early, that fails to start, or that was killed leaves nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from ruckig import Ruckig

from katana450.assembly.robot_session import find_robot
from katana450.assembly.supervised import SupervisorPipe
from katana450.assembly.supervisor import (
    ChildSpec,
    Supervisor,
)
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder
from katana450.extensions.recording.live import recorder
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.browser.server import ROOT, free_port
from tests.waiting import until

COMMAND = (sys.executable, "-m", "katana450", "serve", "--no-record", "--port")


def wait_for_work(pid: int, seconds: float) -> None:
    """Wait until the process has computed for ``seconds``, which takes longer on a busy machine."""
    stat, tick = Path(f"/proc/{pid}/stat"), os.sysconf("SC_CLK_TCK")
    if not stat.exists():
        time.sleep(seconds)
        return
    until(lambda: sum(map(int, stat.read_text().rsplit(")")[1].split()[11:13])) >= seconds * tick)


@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C to a group of processes")
@pytest.mark.parametrize("seconds", [pytest.param(0.06, marks=pytest.mark.long), 0.1])
def test_interrupt_during_the_start_leaves_no_traceback(seconds: float) -> None:
    with subprocess.Popen(
        (*COMMAND, str(free_port())),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=ROOT,
        start_new_session=True,
    ) as server:
        wait_for_work(server.pid, seconds)
        os.killpg(server.pid, signal.SIGINT)
        output = server.communicate(timeout=180.0)[0]
    assert "Traceback" not in output


def failing(_supervisor: SupervisorPipe) -> None:
    # As any arm does, it loads a library that lists at exit what an error still holds.
    robot = find_robot(Settings(), URDF_PATH, None)
    raise OSError(f"It fails with {robot.session}.")


def test_failed_start_lists_no_leaks(capfd: pytest.CaptureFixture[str]) -> None:
    supervisor = Supervisor([ChildSpec("it", "It", failing, 5.0)], threading.Event())
    supervisor.start()
    supervisor._children["it"].process.join(180.0)
    supervisor.stop()
    errors = capfd.readouterr().err
    assert "It fails with" in errors
    assert "leaked" not in errors


def ended_amid_work(_supervisor: SupervisorPipe) -> None:
    holding = threading.Event()

    def plan() -> None:
        held = Ruckig(5, 0.01)
        holding.set()
        time.sleep(60.0)
        del held

    threading.Thread(target=plan, daemon=True).start()
    holding.wait()
    print("It ends.")


def test_end_amid_work_of_a_thread_lists_no_leaks(capfd: pytest.CaptureFixture[str]) -> None:
    supervisor = Supervisor([ChildSpec("it", "It", ended_amid_work, 5.0)], threading.Event())
    supervisor.start()
    process = supervisor._children["it"].process
    process.join(180.0)
    supervisor.stop()
    output = capfd.readouterr()
    assert process.exitcode == 0
    assert "It ends." in output.out
    assert "leaked" not in output.err


def test_server_that_ends_early_reports_no_lost_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def claim(_folder: EpisodeFolder) -> None:
        # As for the address, whose folder the server removes when it ends.
        ended.set()
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(EpisodeFolder, "claim", claim)
    config, ended = SimpleNamespace(episodes=tmp_path), threading.Event()
    for _ in range(2):
        episodes = recorder._episodes(config, Mock(), Mock(), ended)  # type: ignore[arg-type]
        assert isinstance(episodes, InputError)
    assert not caplog.text
