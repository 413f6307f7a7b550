"""Test ``katana450 run --unattended``: the program outlives its terminal until it is stopped."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.extensions.programs.serve_options import OWNER_SILENCE
from tests.browser.server import ATTENTIVE_APP, ROOT, AppServer
from tests.gateway.client import ask
from tests.gateway.test_program_owner import SCRIPT, clear_stop, state_of, wait


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer(ATTENTIVE_APP) as server:
        yield server


@pytest.mark.long
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_unattended_program_outlives_its_terminal(
    server: AppServer, tmp_path: Path, end: signal.Signals
) -> None:
    script = tmp_path / "wave.yaml"
    script.write_text(SCRIPT)
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
