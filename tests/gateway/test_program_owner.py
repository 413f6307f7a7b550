"""Test that a program comes to rest when its owner falls silent, unless it runs unattended."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from katana450.client import connect
from katana450.extensions.programs.serve_options import OWNER_SILENCE
from katana450.server.api import answers
from tests.browser.server import ATTENTIVE_APP, ROOT, AppServer
from tests.gateway.test_programs import WAVE
from tests.gateway.virtual import VirtualServer
from tests.waiting import state_when


def test_silent_owner_on_an_open_socket_ends_its_program(local: VirtualServer) -> None:
    with local.speaking("Owner") as owner:
        owner.say(do="program", text=WAVE)
        while owner.answer(do="query")["program"]["status"] != "ready":
            local.sleep(0.05)
        owner.say(do="steer", order="run")
        began = time.monotonic()
        while (program := local.state().program) is not None and program.status != "stopped":
            local.sleep(0.02)
        assert OWNER_SILENCE <= time.monotonic() - began < OWNER_SILENCE + 0.1
    assert program is not None
    assert "Owner sends no heartbeats" in program.why
    # The arm rests on its path. It is not stopped, and the lease is free.
    local.sleep(1.0)
    state = local.state()
    assert (state.stopped, state.holder, state.moving) == (None, None, False)
    assert 0.05 < state.q[0] < np.deg2rad(100) - 0.05


def is_in(status: str, state: answers.State) -> bool:
    return state.program is not None and state.program.status == status


@pytest.mark.long
def test_unattended_program_outlives_its_terminal(tmp_path: Path) -> None:
    script = tmp_path / "wave.yaml"
    script.write_text(WAVE)
    with AppServer(ATTENTIVE_APP) as server, connect(server.url, "Watcher") as watcher:
        command = [sys.executable, "-m", "katana450", "run", str(script), "--url", server.url]
        with subprocess.Popen(
            [*command, "--unattended"], stderr=subprocess.PIPE, text=True, cwd=ROOT
        ) as owner:
            state_when(watcher, partial(is_in, "running"))
            time.sleep(0.2)
            owner.send_signal(signal.SIGINT)
            errors = owner.communicate(timeout=20)[1]
        assert owner.returncode == 0
        assert "the program runs on, unattended" in errors
        time.sleep(2.0 * OWNER_SILENCE)
        state = watcher.query(answers.State)
        assert state.moving
        assert state.program is not None
        assert (state.program.status, state.program.unattended) == ("running", True)
        assert state.program.by.startswith("Terminal")
        assert str(state.program.began).endswith("+00:00")
        watcher.stop()
        state = state_when(watcher, partial(is_in, "stopped"))
        assert state.program is not None
        assert (state.program.unattended, state.holder) == (False, None)
        watcher.clear_stop()
