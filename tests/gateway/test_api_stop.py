"""Test STOP and silence while a program drives the arm."""

from __future__ import annotations

import time

import pytest

from katana450.arm.control.lease import LEASE_TIMEOUT
from katana450.client import Client, RefusedError
from katana450.server.api import answers, requests
from katana450.settings import Settings
from tests.gateway.postures import READY, THERE
from tests.gateway.virtual import VirtualServer

SLOW_WATCH = 0.1
"""[Hz] Rate of the states of a watcher that learns of a stop between them."""


def under_way(program: Client) -> None:
    program.ask(requests.Speed(value=0.2))
    program.ask(requests.Joints(q=THERE))
    time.sleep(0.1)


def test_any_window_can_stop_a_program(local: VirtualServer, program: Client) -> None:
    under_way(program)
    with local.connect("Watcher") as other, pytest.raises(RefusedError, match=r"Test.*holds"):
        other.ask(requests.Home())
    assert local.ask("/api/v1/stop", data=b"", X_Name="bystander")[0] == 204
    assert program.query(answers.State).stopped == "bystander pressed STOP."
    with pytest.raises(RefusedError, match="clear the stop first"):
        program.joints(READY)
    while (rest := program.query(answers.State)).moving:
        time.sleep(0.02)
    program.clear_stop()
    time.sleep(0.3)
    assert program.query(answers.State).q == rest.q


def test_slow_watcher_learns_of_a_stop_at_once(local: VirtualServer, program: Client) -> None:
    under_way(program)
    with local.connect("Watcher") as watcher:
        states = watcher.states(SLOW_WATCH)
        next(states)
        began = time.monotonic()
        program.stop()
        while next(states).stop != "confirmed":
            pass
        assert time.monotonic() - began < 0.1
        program.clear_stop()
        while next(states).stopped is not None:
            pass
        # It can be cleared only at rest, and 1 s after it.
        assert time.monotonic() - began < 2.0


def test_silent_program_causes_a_stop_and_loses_the_lease(local: VirtualServer) -> None:
    with local.speaking("Frozen") as silent:
        silent.say(do="speed", value=0.1)
        silent.say(do="joints", q=THERE.tolist())
        began = time.monotonic()
        while local.state().stopped is None:
            local.sleep(0.01)
        assert Settings.silence <= time.monotonic() - began < Settings.silence + 0.1
        assert local.state().stopped == "Frozen fell silent while the arm moved."
        assert local.state().holder == "Frozen"
        local.sleep(LEASE_TIMEOUT)
        assert local.state().holder is None


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
