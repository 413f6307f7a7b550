"""``katana450 run`` at a terminal: begin at a step, pause, slow down, continue."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from katana450.cli.main import main
from katana450.client import Client, connect
from katana450.server.api import answers
from tests.browser.server import AppServer
from tests.gateway.test_programs import wait
from tests.waiting import until

pty = pytest.importorskip("pty", reason="Windows has no pseudo-terminals")

ROOT = Path(__file__).resolve().parents[2]

SCRIPT = """\
name: Three steps
steps:
  - joints: [12, -64, 85, 8, 0]
  - joints: [24, -64, 85, 8, 0]
  - joints: [12, -68, 85, 8, 0]
"""


class Terminal:
    """A command at a pseudo-terminal."""

    def __init__(self, *command: str) -> None:
        self._end, inner = pty.openpty()
        self.process = subprocess.Popen(command, stdin=inner, stdout=inner, stderr=inner, cwd=ROOT)
        os.close(inner)
        os.set_blocking(self._end, False)
        self.text = ""

    def read(self) -> str:
        """Return everything that was printed."""
        try:
            while data := os.read(self._end, 10_000):
                self.text += data.decode()
        except (BlockingIOError, OSError):
            pass
        return self.text

    def wait_for(self, text: str, seconds: float = 30.0) -> None:
        """Wait until ``text`` is printed after what was waited for before."""
        due = time.monotonic() + seconds
        while text not in self.read():
            assert time.monotonic() < due, self.text
            time.sleep(0.05)
        self.text = self.text.split(text, 1)[1]

    def type(self, text: str) -> None:
        os.write(self._end, text.encode())

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._end)


@contextmanager
def terminal(server: AppServer, *options: str | Path) -> Iterator[Terminal]:
    command = [sys.executable, "-m", "katana450", "run", *map(str, options), "--url", server.url]
    found = Terminal(*command)
    try:
        yield found
    finally:
        found.close()


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer() as server:
        yield server


@pytest.fixture
def watcher(server: AppServer) -> Iterator[Client]:
    with connect(server.url, "Watcher") as watcher:
        yield watcher


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "three.yaml"
    path.write_text(SCRIPT, encoding="utf-8")
    return path


def test_terminal_pauses_slows_and_continues(
    server: AppServer, watcher: Client, script: Path
) -> None:
    with terminal(server, script, "--from-step", "2", "--pause-before", "3") as shown:
        running = wait(watcher, lambda each: each.status == "running")
        assert running.step == 2
        assert running.breakpoints == (3,)
        shown.type("\n")
        wait(watcher, lambda each: each.status == "paused")
        shown.type("fast\n")
        shown.wait_for("a number sets the speed")
        shown.type("40 %\n")
        until(lambda: watcher.query(answers.State).speed == 0.4)
        shown.type("\n")
        wait(watcher, lambda each: each.status == "running")
        watcher.stop()
        shown.wait_for("Enter continues at step 2")
        shown.type("\n")
        shown.wait_for("clear the stop")
        # The lease stays free for the owner of the program.
        watcher.clear_stop()
        shown.type("\n")
        paused = wait(watcher, lambda each: each.status == "paused")
        assert paused.step == 3
        shown.type("\n")
        shown.wait_for("Done.")
        assert shown.process.wait(10.0) == 0
    q = np.rad2deg(watcher.query(answers.State).q)
    assert q == pytest.approx([12, -68, 85, 8, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--from-step", "2", "--headless"], "need a server"),
        (["--from-step", "0"], "expected a step"),
        (["--pause-before", "1,x"], "expected a step"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    script: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    with suppress(SystemExit):
        assert main(["run", str(script), *options]) == 1
    assert said in capsys.readouterr().err
