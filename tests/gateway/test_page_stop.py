"""Test STOP pressed by a page, and the stop caused by a page that hangs."""

from __future__ import annotations

import time

from katana450.settings import Settings
from tests.gateway.virtual import VirtualServer


def test_hanging_page_of_the_driver_causes_a_stop_in_time(local: VirtualServer) -> None:
    async def hang() -> list[float]:
        took, control = [], await local.control()
        await control.say("take")
        await control.wait(mine=True)
        for angle in (2.5, -2.5, 2.5):
            await control.say("joint", axis=1, value=angle)
            await control.wait(mood="moving")
            control.alive = False
            await control.wait(mood="stopped")
            took.append(time.perf_counter() - control.last_beat)
            control.alive = True
            await control.clear_stop()
        await control.close()
        return took

    # A check every 20 ms, and a status every tenth of a second.
    for seconds in local.run(hang()):
        assert Settings.silence <= seconds < Settings.silence + 0.15
