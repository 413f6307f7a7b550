"""Test a frozen process of the arm, and one without a control loop: reported and stopped."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from katana450.client import connect
from katana450.server.api import answers, requests
from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.gateway.client import ask
from tests.gateway.lines import speaking
from tests.gateway.postures import FAR

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="finds the server's processes as Linux lists them"
)

REPORTED = 0.5
"""Time [s] after which missing states are reported; a busy machine gets twice as long."""

# Ends the control thread as soon as the arm moves, like an unexpected error. Every process of the
# server imports this file.
FATAL = """
import sys
from katana450.cli.main import main
from katana450.arm.runtime.loop import ControlLoop
tick = ControlLoop.tick
def fatal(loop):
    tick(loop)
    if loop.state_publisher.snapshot.state.moving:
        raise SystemExit
ControlLoop.tick = fatal
if __name__ == "__main__":
    sys.exit(main(["serve", "--port", sys.argv[1]]))
"""

# Lets the thread that sends the states wait for ever as soon as the arm moves.
MUTE = """
import sys
import threading
from katana450.cli.main import main
from katana450.arm.runtime.arm_end import ArmEnd
send = ArmEnd._send
def mute(end, message):
    if message.snapshot.state.moving:
        threading.Event().wait()
    send(end, message)
ArmEnd._send = mute
if __name__ == "__main__":
    sys.exit(main(["serve", "--port", sys.argv[1]]))
"""


def state_of(server: AppServer) -> dict[str, object]:
    state: dict[str, object] = json.loads(ask(f"{server.url}/api/v1/state")[2])
    return state


def test_arm_that_was_frozen_rests_and_waits_for_clear_stop() -> None:
    command = (*ATTENTIVE_APP, "--silence", "0.6", "--lines", "0")
    with AppServer(command) as server, speaking(server, "Driver") as driver:
        driver.say(do="joints", q=FAR.tolist())
        end = time.monotonic() + 20.0
        while driver.answer(do="query")["q"][0] < 0.2:
            assert time.monotonic() < end
            time.sleep(0.02)
        with server.frozen(server.arm):
            end = time.monotonic() + 10.0
            while state_of(server)["stopped"] is None:
                driver.say(do="heartbeat")
                assert time.monotonic() < end
                time.sleep(0.1)
            refused = driver.answer(do="clear_stop")
            assert "has not answered" in refused["why"]
        assert "did not answer" in str(state_of(server)["stopped"])
        end = time.monotonic() + 5.0
        while (state := state_of(server))["stop"] != "confirmed" or state["moving"]:
            assert time.monotonic() < end
            time.sleep(0.05)
        assert driver.clear_stop()["is"] == "done"
        time.sleep(0.5)
        np.testing.assert_array_equal(state_of(server)["q"], state["q"])


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (FATAL, "The arm's process ended with status 1"),
        (MUTE, "no longer reaches the page's server"),
    ],
    ids=["its loop has ended", "its states reach no page"],
)
def test_arm_that_fails_is_started_again_stopped(tmp_path: Path, text: str, words: str) -> None:
    app = tmp_path / "fails.py"
    app.write_text(text, encoding="utf-8")
    with AppServer((sys.executable, str(app), "{port}")) as server:
        killed = server.arm
        with connect(server.url, "Driver") as arm:
            arm.ask(requests.Joints(q=FAR.tolist()))
            end = time.monotonic() + 20.0
            while (state := arm.query(answers.State)).stop != "confirmed" or state.age > REPORTED:
                assert time.monotonic() < end
                time.sleep(0.05)
            assert not state.moving
            assert server.arm != killed
            reasons = [line.finding.reason for line in arm.query(answers.EventLog).lines]
            assert "restarted" in reasons
        assert words in server.output
