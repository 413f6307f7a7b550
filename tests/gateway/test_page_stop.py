"""Test STOP pressed by a page, and the stop caused by a page that hangs."""

from __future__ import annotations

import asyncio
import time

import pytest

from katana450.settings import Settings
from tests.browser.server import AppServer
from tests.gateway.client import ask, controlling, enter
from tests.gateway.virtual import VirtualServer


@pytest.mark.long
def test_stop_press_over_two_channels_counts_once() -> None:
    async def act() -> None:
        with AppServer() as server:
            cookie = enter(server.url)

            def post(query: str = "") -> None:
                answer = ask(
                    f"{server.url}/stop{query}", data=b"", Cookie=cookie, Origin=server.url
                )
                assert answer[0] == 204

            async with controlling(server.url, cookie) as control:
                await control.wait(mood="ok")
                await control.say("stop", press="one")
                await control.wait(mood="stopped")
                await control.clear_stop()
                post("?press=one")
                await asyncio.sleep(0.3)
                assert control.status["stopped"] is None
                # A press with another name counts as a new one.
                for query in ("?press=two", "?press=" + 100 * "x", "?press=", ""):
                    post(query)
                    await control.wait(mood="stopped")
                    await control.clear_stop()

    asyncio.run(act())


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
