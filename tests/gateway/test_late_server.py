"""A program pauses while only the page's server is late, and continues by itself."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.session import Session
from katana450.arm.control.state import Finding, Reason
from katana450.extensions.programs.extension import OWNER_SILENCE
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service.command_gate import SETTLE_TIME
from tests.browser.server import ROOT, SIMULATION_APP, AppServer
from tests.gateway.client import ask
from tests.gateway.test_hub import PAGES
from tests.gateway.test_program_owner import wait
from tests.gateway.test_program_runner import Staged

LATE = Finding(Reason.SERVER_SILENT, 0.28)
PAUSED = Finding(Reason.PAUSED)


class LateServer(Staged):
    """A table whose program was paused because the server was late."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.owner = self.join(PAGES[0])
        self.plan(self.owner)
        self.programs.steer(self.owner, ProgramOrder.RUN)
        self.wait(0.1, self.owner)
        self.arm.rest = replace(self.arm.rest, paused=True, findings=(PAUSED, LATE))

    @property
    def resumes(self) -> int:
        return sum(isinstance(each, cmd.Resume) for each in self.arm.commands)


@pytest.fixture
def table(session: Session) -> LateServer:
    return LateServer(session)


def test_program_resumes_after_what_waited_was_read(table: LateServer) -> None:
    table.wait(0.9 * SETTLE_TIME, table.owner)
    assert (table.resumes, table.status) == (0, "paused")
    table.wait(0.5 * SETTLE_TIME, table.owner)
    assert table.resumes > 0
    table.arm.rest = replace(table.arm.rest, paused=False, findings=())
    table.wait(0.1, table.owner)
    assert table.status == "running"


def test_pause_of_a_person_and_a_stop_last(table: LateServer) -> None:
    table.arm.rest = replace(table.arm.rest, findings=(PAUSED,))
    table.wait(3.0, table.owner)
    assert (table.resumes, table.status) == (0, "paused")
    table.arm.rest = replace(table.arm.rest, findings=(PAUSED, LATE))
    table.stop("Somebody")
    table.wait(3.0, table.owner)
    assert (table.resumes, table.status) == (0, "stopped")


def test_lost_owner_ends_the_paused_program(table: LateServer) -> None:
    table.programs._owner._timeout = 0.5 * SETTLE_TIME
    table.wait(OWNER_SILENCE)
    progress = table.programs.progress()
    assert progress is not None
    assert (progress.status, "sends no heartbeats" in progress.why) == ("stopped", True)


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer(SIMULATION_APP) as server:
        yield server


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="finds the front end as Linux lists processes")
def test_program_reaches_its_end_although_the_server_was_late(
    server: AppServer, tmp_path: Path
) -> None:
    script = tmp_path / "wave.yaml"
    script.write_text(
        "name: Wave\nspeed: 0.6\nsteps:\n  - joints: [100, -60, 85, 8, 0]\n  - home\n"
    )
    command = [sys.executable, "-m", "katana450", "run", str(script), "--url", server.url]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=ROOT) as owner:
        try:
            while wait(server, "running")["q"][0] < 0.02:
                time.sleep(0.02)
            front = server.front
            os.kill(front, signal.SIGSTOP)
            time.sleep(0.5)
            os.kill(front, signal.SIGCONT)
            assert owner.wait(60.0) == 0
        finally:
            owner.kill()
    assert "The program Wave continues after a pause" in server.output
    assert ask(f"{server.url}/health")[0] == 200
