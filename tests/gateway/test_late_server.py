"""A program pauses while only the page's server is late, and continues by itself."""

from __future__ import annotations

from dataclasses import replace

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.session import Session
from katana450.arm.control.state import Finding, Reason
from katana450.extensions.programs.serve_options import OWNER_SILENCE
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service.command_gate import SETTLE_TIME
from tests.gateway.test_hub import PAGES
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
