"""Test a frozen process of the arm, and one without a control loop: reported and stopped."""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import pytest

from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.gateway.client import ask
from tests.gateway.lines import speaking
from tests.gateway.postures import FAR

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="finds the server's processes as Linux lists them"
)


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
