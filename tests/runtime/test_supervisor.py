"""The supervisor with small processes: ends, hangs, errors, kept states and notices."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from katana450.assembly import supervisor as supervisor_module
from katana450.assembly.supervised import KEPT, READY, SupervisorPipe
from katana450.assembly.supervisor import (
    START_SILENCE,
    Child,
    ChildSpec,
    Supervisor,
)
from katana450.errors import ConfigurationError
from tests.waiting import until

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sends signals of Linux and macOS")


def worker(folder: Path, state: dict[bytes, bytes] | None, supervisor: SupervisorPipe) -> None:
    """Write what happens to ``folder``, until the supervisor ends this process."""
    count = 0 if state is None else int(state[KEPT])
    (folder / f"pid{count}").write_text(str(os.getpid()))
    supervisor.keep(KEPT, str(count + 1).encode())
    supervisor.report(READY)
    supervisor.ended.wait()
    (folder / f"ended{count}").touch()


def idler(folder: Path, supervisor: SupervisorPipe) -> None:

    def note(text: str) -> None:
        (folder / "notice").write_text(text)

    supervisor.notify = note
    supervisor.report(READY)
    supervisor.ended.wait()


def stubborn(folder: Path, supervisor: SupervisorPipe) -> None:
    """Report ready, and send no heartbeats."""
    with (folder / "started").open("a") as file:
        file.write("x")
    supervisor.prove(lambda: False)
    supervisor.report(READY)
    time.sleep(60.0)


def refusing(_folder: Path, _supervisor: SupervisorPipe) -> None:
    raise ConfigurationError("The reason.")


def failing(_folder: Path, _supervisor: SupervisorPipe) -> None:
    raise SystemExit(3)


def careless(folder: Path, supervisor: SupervisorPipe) -> None:
    """Meet an error in a thread, once the first start is over."""

    def work() -> None:
        until((folder / "running").exists)
        with (folder / "started").open("a") as file:
            file.write("x")
        raise LookupError("no such thing")

    supervisor.report(READY)
    threading.Thread(target=work).start()
    supervisor.ended.wait()


class Running:
    """A supervisor that runs in a thread."""

    def __init__(self, *specs: ChildSpec) -> None:
        self._stopping = threading.Event()
        self.supervisor = Supervisor(specs, self._stopping)
        self.supervisor.start()
        for spec in specs:
            self.supervisor.wait_for(spec.name, READY)
        self._thread = threading.Thread(target=self.supervisor.run)
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()
        self.supervisor.stop()


# Processes that hang are ended in the next test too.
@pytest.mark.parametrize(
    "number", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.long)]
)
def test_lost_process_starts_again_with_its_state(tmp_path: Path, number: signal.Signals) -> None:
    running = Running(
        ChildSpec("worker", "The worker", partial(worker, tmp_path), 1.0, keeps=True),
        ChildSpec("idler", "The idler", partial(idler, tmp_path), 1.0),
    )
    try:
        until((tmp_path / "pid0").exists)
        time.sleep(0.2)
        os.kill(int((tmp_path / "pid0").read_text()), number)
        until((tmp_path / "pid1").exists)
        until((tmp_path / "notice").exists)
        notice = (tmp_path / "notice").read_text()
        assert notice == "The worker ended with status -9 and is started again."
    finally:
        running.stop()
    # Each process ends by itself when the supervisor asks it to.
    assert (tmp_path / "ended1").exists()
    assert not (tmp_path / "ended0").exists()


def test_process_without_heartbeats_is_ended(tmp_path: Path) -> None:
    running = Running(ChildSpec("stubborn", "It", partial(stubborn, tmp_path), 0.5))
    try:
        until(lambda: len((tmp_path / "started").read_text()) >= 2)
    finally:
        running.stop()


def test_error_in_any_thread_ends_the_process(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    running = Running(ChildSpec("careless", "It", partial(careless, tmp_path), 5.0))
    (tmp_path / "started").touch()
    (tmp_path / "running").touch()
    try:
        until(lambda: len((tmp_path / "started").read_text()) >= 2)
    finally:
        running.stop()
    assert "LookupError: no such thing" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("work", "message"), [(refusing, "The reason."), (failing, "It did not start: it ended; see")]
)
def test_error_of_the_first_start_ends_the_server(
    tmp_path: Path, work: Callable[[Path, SupervisorPipe], None], message: str
) -> None:
    supervisor = Supervisor(
        [ChildSpec("it", "It", partial(work, tmp_path), 1.0)], threading.Event()
    )
    supervisor.start()
    with pytest.raises(ConfigurationError, match=message):
        supervisor.wait_for("it", READY)
    supervisor.stop()


def test_hang_at_the_first_start_ends_the_server_with_its_reason(tmp_path: Path) -> None:
    spec = ChildSpec("stubborn", "It", partial(stubborn, tmp_path), 0.5)
    supervisor = Supervisor([spec], threading.Event())
    supervisor.start()
    with pytest.raises(ConfigurationError, match="did not start: it has not answered for"):
        supervisor.wait_for("stubborn", "another word")
    supervisor.stop()


class Unstartable:
    """The function of a process that the system refuses to start."""

    def __call__(self, _supervisor: SupervisorPipe) -> None: ...

    def __reduce__(self) -> str:
        raise OSError("no more processes")


def test_supervisor_ends_although_a_process_could_not_be_started(tmp_path: Path) -> None:
    specs = [
        ChildSpec("idler", "The idler", partial(idler, tmp_path), 1.0),
        ChildSpec("it", "It", Unstartable(), 1.0),
        ChildSpec("later", "The later one", partial(idler, tmp_path), 1.0),
    ]
    supervisor = Supervisor(specs, threading.Event())
    with pytest.raises(OSError, match="no more"):
        supervisor.start()
    supervisor.stop()


def test_excused_time_ends_now(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(supervisor_module, "time", SimpleNamespace(monotonic=lambda: now))
    child = Child(ChildSpec("it", "It", partial(idler, tmp_path), 1.0))
    # More than the time since the last message, as when one has just been read.
    child.excuse(2 * now)
    assert child.hangs is None
    now += START_SILENCE + 1.0
    assert child.hangs == f"has not answered for {START_SILENCE + 1.0:.1f} s"


def test_process_that_supervises_loads_no_calculation() -> None:
    """It takes part of the start, and stays for as long as the server."""
    script = (
        "import sys, katana450.cli.serve\n"
        "loaded = {'numpy', 'ruckig', 'katana450.arm.control.state.state'} & sys.modules.keys()\n"
        "assert not loaded, loaded"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60.0)
