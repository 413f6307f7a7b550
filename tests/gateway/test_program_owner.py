"""Test that a program comes to rest when its owner falls silent on an open connection."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.extensions.programs.serve_options import OWNER_SILENCE
from tests.browser.server import ATTENTIVE_APP, ROOT, AppServer
from tests.gateway.client import ask, state_of
from tests.gateway.lines import post
from tests.gateway.test_programs import WAVE
from tests.gateway.virtual import VirtualServer


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer(ATTENTIVE_APP) as server:
        yield server


def wait(server: AppServer, status: str, seconds: float = 30.0) -> dict[str, Any]:
    """Wait until the program is ``status`` and, if it ended, the arm is at rest."""
    end = time.monotonic() + seconds
    while True:
        state = state_of(server)
        program = state.get("program") or {"status": None}
        ended = status in ("running", "ready") or not state["moving"]
        if program["status"] == status and ended:
            return state
        assert time.monotonic() < end, program
        time.sleep(0.02)


def clear_stop(server: AppServer) -> None:
    end = time.monotonic() + 10.0
    while (state := state_of(server))["stopped"] is not None and not state["clearable"]:
        assert time.monotonic() < end
        time.sleep(0.02)
    assert post(server, do="clear_stop")[0] == 200
    # The lease stays free for the owner of a program that was stopped.
    if state_of(server)["holder"] is not None:
        assert post(server, do="release_lease")[0] == 200


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


@pytest.mark.long
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_unattended_program_outlives_its_terminal(
    server: AppServer, tmp_path: Path, end: signal.Signals
) -> None:
    script = tmp_path / "wave.yaml"
    script.write_text(WAVE)
    command = [sys.executable, "-m", "katana450", "run", str(script), "--url", server.url]
    with subprocess.Popen(
        [*command, "--unattended"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as owner:
        try:
            wait(server, "running")
            time.sleep(0.2)
            owner.send_signal(end)
            errors = owner.communicate(timeout=20)[1]
        finally:
            owner.kill()
    if end is signal.SIGINT:
        assert owner.returncode == 0
        assert "the program runs on, unattended" in errors
    time.sleep(2.0 * OWNER_SILENCE)
    state = wait(server, "running", 1.0)
    assert state["moving"]
    assert state["program"]["unattended"]
    assert state["program"]["by"].startswith("Terminal")
    assert state["program"]["began"].endswith("+00:00")
    assert ask(f"{server.url}/api/v1/stop", data=b"", Origin=server.url)[0] == 204
    state = wait(server, "stopped")
    assert not state["program"]["unattended"]
    assert state["holder"] is None
    clear_stop(server)
    assert state_of(server)["stopped"] is None
