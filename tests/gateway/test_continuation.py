"""A moment is simulated before the arm continues from it, and what happens meanwhile counts."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from katana450.arm.control.lease import Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.client import Client, RefusedError
from katana450.extensions.recording.playback.store import RecordingStore
from katana450.server.api import answers, requests
from katana450.server.web.access_links import AccessFile
from tests.gateway.client import HOUR
from tests.gateway.virtual import VirtualServer


@pytest.fixture
def meanwhile(monkeypatch: pytest.MonkeyPatch) -> list[Callable[[], object]]:
    """Return a list of what happens while the ready posture is simulated."""
    acts: list[Callable[[], object]] = []

    async def state_at(_store: object, _name: str, _t: float, session: Session) -> State:
        for act in acts:
            act()
        return session.begin(session.ready, 0.0, 0.0)

    monkeypatch.setattr(RecordingStore, "state_at", state_at)
    return acts


def test_request_is_void_after_a_stop_a_change_or_the_end_of_its_sender(
    local: VirtualServer, program: Client, meanwhile: list[Callable[[], object]]
) -> None:
    before, [driver] = program.nudge(1, 0.2).q, local.hub.participants
    meanwhile.append(lambda: local.hub.stop(driver.actor))
    with pytest.raises(RefusedError, match="The arm is stopped"):
        program.fork(1.0)
    program.clear_stop()
    meanwhile[:] = [lambda: local.hub.release_lease(driver)]
    with pytest.raises(RefusedError, match="After you began this"):
        program.fork(1.0, wait=5.0)
    meanwhile[:] = [lambda: local.hub.leave(driver)]
    with pytest.raises(RefusedError, match="no longer connected"):
        program.fork(1.0)
    local.sleep(1.0)
    assert local.state().q == before


def test_arm_continues_once_the_answer_comes_and_undo_takes_it_back(
    local: VirtualServer, program: Client, meanwhile: list[Callable[[], object]]
) -> None:
    assert not meanwhile
    ready = local.hub.present().session.ready
    for wait in (None, 5.0):
        nudged = program.nudge(1, 0.2)
        np.testing.assert_array_equal(program.fork(1.0, wait=wait).q, ready)
        assert program.go(requests.Undo()).q == nudged.q
    assert local.post(do="continue_from", t=1.0, wait=5.0)[0] == 409
    program.release_lease()
    status, answer = local.post(do="continue_from", t=1.0, wait=5.0, id=7)
    assert (status, answer["id"], answer["end"]["how"]) == (200, 7, "reached")
    assert program.query(answers.State).holder is None


def test_viewer_is_refused_before_anything_is_simulated(
    guarded: VirtualServer, file: AccessFile, meanwhile: list[Callable[[], object]]
) -> None:
    meanwhile.append(pytest.fail)
    token = file.give("Vera", Role.VIEWER, time.time() + HOUR)
    with guarded.connect(token=token) as viewer, pytest.raises(RefusedError, match="not drive"):
        viewer.fork(1.0)
