"""An arm that hangs, and a driver that hangs, never delay STOP to the page and the others."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from katana450.arm.control.arm_commands import ArmAct
from katana450.client import connect
from katana450.server.api import answers, requests
from katana450.server.api.motion_requests import OperateArm
from tests.browser.server import APP, AppServer
from tests.browser.session import READY
from tests.gateway.client import controlling
from tests.gateway.test_isolation import under_way
from tests.real_arm.emulated import emulator_process
from tests.real_arm.test_arm_commands import wait_for

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(sys.platform == "win32", reason="freezes a process by a signal"),
]

PROMPT = 0.3
"""[s] Time in which STOP is confirmed or reported; it takes 2 ms on a machine that is not busy."""

# A driver that breaks the rule that no method may block. Every process of the server imports this.
HANGING = """
import sys, time
from pathlib import Path
from katana450.cli.main import main
from katana450.arm.drivers.simulated import SimulatedDriver
send = SimulatedDriver.send
def hanging(*args, **options):
    while Path(sys.argv[2]).exists():
        time.sleep(0.05)
    return send(*args, **options)
SimulatedDriver.send = hanging
if __name__ == "__main__":
    sys.exit(main(["serve", "--port", sys.argv[1], "--no-record", "--no-idle-planning"]))
"""


def test_arm_that_hangs_delays_no_stop() -> None:
    with emulator_process("--calibrated") as (emulator, port):
        arm = ("--arm", f"tcp://127.0.0.1:{port}")
        with (
            AppServer((*APP, *arm)) as app,
            connect(app.url, "Driver") as driver,
            connect(app.url, "Watcher") as watcher,
        ):
            for act, mode in ((ArmAct.CONNECT, "uncalibrated"), (ArmAct.ENGAGE, "holding")):
                driver.ask(OperateArm(act=act, confirmed=True))
                wait_for(driver, mode)
            driver.clear_stop()
            driver.ask(requests.Joints(q=READY.tolist()))
            wait_for(watcher, "moving")
            try:
                emulator.send_signal(signal.SIGSTOP)
                begun = time.perf_counter()
                # Another participant than the driver presses STOP.
                assert isinstance(watcher.ask(requests.Stop()), answers.Done)
                assert time.perf_counter() - begun < PROMPT
                # The answer can come before the tick that stops.
                while driver.query(answers.State).stop != "confirmed":
                    assert time.perf_counter() - begun < 2.0 * PROMPT
                wait_for(driver, "lost")
            finally:
                emulator.send_signal(signal.SIGCONT)
            wait_for(driver, "uncalibrated")
            before = driver.query(answers.State).q
            time.sleep(0.5)
            assert driver.query(answers.State).q == pytest.approx(before, abs=2e-3)


def test_driver_that_hangs_delays_no_stop_to_page_and_others(tmp_path: Path) -> None:
    app, flag = tmp_path / "hanging.py", tmp_path / "hangs"
    app.write_text(HANGING, encoding="utf-8")

    async def act(server: AppServer) -> None:
        async with controlling(server.url) as page:
            with connect(server.url, "Driver") as driver:
                await asyncio.to_thread(under_way, driver)
                flag.touch()
                await asyncio.sleep(0.2)
                begun = time.perf_counter()
                await page.say("stop")
                shown = await page.wait(stop="requested")
                assert time.perf_counter() - begun < PROMPT
                assert shown["mood"] == "stopped"
                state = await asyncio.to_thread(driver.query, answers.State)
                assert time.perf_counter() - begun < 2.0 * PROMPT
                assert state.stop == "requested"
                # Everybody else reads, for as long as the driver hangs.
                shown = await page.wait(headline="Stop requested")
                assert "has not confirmed" in shown["why"]
                flag.unlink()
                await page.wait(stop="confirmed", headline="Stopped")
                state = await asyncio.to_thread(driver.query, answers.State)
                assert not state.moving

    with AppServer((sys.executable, str(app), "{port}", str(flag))) as server:
        try:
            asyncio.run(act(server))
        finally:
            with suppress(FileNotFoundError):
                os.unlink(flag)
