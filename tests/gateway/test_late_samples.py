"""Test that samples which arrive late are not executed, and that their end always is."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest
import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import PAUSE_TIMEOUT, SilenceProfile
from katana450.arm.control.state.state import Reason
from katana450.errors import LateError
from katana450.server.api import requests
from katana450.server.service.budget import Budgets
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.heartbeats import WINDOW, LeastDelay
from katana450.server.service.participants import Participant
from katana450.server.viser_bridge.guard import Guard, MessageFilter, Ruling
from katana450.settings import Settings
from tests.gateway.test_command_gate import Hooked
from tests.gateway.test_hub import PAGES, Table, moves
from tests.viser_bridge import internals

LIMIT = Settings.sample_delay
FORWARD = (0.06, 0.0, 0.0, 0.0, 0.0)
OFFSET = -4000.0
"""[s] Clock of the client minus that of the server."""


@pytest.fixture
def table(session: Session) -> Table:
    table = Table(session.begin(session.ready, 0.0, 0.0))
    table.arm.profile = SilenceProfile.SIMULATION
    return table


class Client:
    """A participant whose requests take ``delay`` [s]."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self._dispatcher = Dispatcher(table.hub)
        self._budget = Budgets(table.hub.clock).of("session")
        self.delay = 0.03
        self.participant: Participant = table.join(PAGES[0])
        self.say(requests.Heartbeat)

    def say(self, kind: Callable[..., requests.Request], **fields: Any) -> None:
        """Let a request arrive now that was made earlier by the delay."""
        request = kind(**fields, made=self._table.t + OFFSET - self.delay)
        self._dispatcher.handle(self.participant, request, self._budget)


def test_delay_counts_from_the_least_whatever_the_clocks_say() -> None:
    for offset in (0.0, 1e6, -1e6):
        least = LeastDelay()
        delays = (0.05, 0.02, 0.2, 0.03)
        excess = [least.excess(t + offset, t + delay) for t, delay in enumerate(delays)]
        assert excess == pytest.approx((0.0, 0.0, 0.18, 0.01), abs=1e-6)


def test_clock_that_drifts_is_followed() -> None:
    least = LeastDelay()
    for number in range(40_000):
        t = 0.5 * number
        # 0.2 s in 1000 s, which is ten times what the clocks of computers do.
        assert least.excess(t - 2e-4 * t, t, LIMIT) < 0.01


def test_longer_route_counts_as_usual_only_after_rest() -> None:
    least = LeastDelay()
    least.excess(0.0, 0.0)

    def excess(t: float, limit: float = math.inf) -> float:
        return least.excess(t - 2.0, t, limit)

    # A hand that holds a key is never followed, and one message after a long silence is not either.
    assert min(excess(0.04 * number, LIMIT) for number in range(1, 1000)) == pytest.approx(2.0)
    assert excess(40.0 + 3.0 * WINDOW, LIMIT) == pytest.approx(2.0)
    start = 80.0
    at_rest = [excess(start + 0.1 * number) for number in range(101)]
    assert at_rest[-1] == 0.0
    assert excess(start + 10.2, LIMIT) == pytest.approx(0.0, abs=1e-9)


def test_late_samples_are_refused_and_their_end_is_not(table: Table) -> None:
    client = Client(table)
    samples: list[tuple[Callable[..., requests.Request], dict[str, Any]]] = [
        (requests.Jog, {"rates": FORWARD}),
        (requests.Servo, {"q": [0.0] * 5}),
        (requests.StepTool, {"by": (0.01, 0.0, 0.0, 0.0, 0.0)}),
        (requests.Nudge, {"axis": 1, "by": 0.01}),
        (requests.Joint, {"axis": 1, "value": 0.1}),
    ]
    others: list[tuple[Callable[..., requests.Request], dict[str, Any]]] = [
        (requests.Jog, {"rates": (0.0,) * 5}),
        (requests.EndDrag, {}),
        (requests.Hold, {}),
        (requests.Home, {}),
        (requests.Stop, {}),
    ]
    delivered: list[cmd.Command] = []
    table.hub.gate.delivered.append(lambda command, *_: delivered.append(command))
    for number, (kind, fields) in enumerate(samples):
        client.delay = 0.03 + LIMIT - 0.01
        client.say(kind, **fields)
        client.delay += 0.02
        with pytest.raises(LateError, match=r"arrived 0.2 s late.*Let go"):
            client.say(kind, **fields)
        assert len(delivered) == number + 1
    client.delay = 2.0
    for kind, fields in others:
        client.say(kind, **fields)
    assert (len(delivered), table.arm.stops) == (len(samples) + len(others) - 1, 1)
    # A client that sends no times is followed as it always was.
    table.hub.gate.submit(cmd.ClearStop(), client.participant.actor)
    table.hub.move(client.participant, cmd.Jog(np.array(FORWARD)))


def test_late_heartbeats_are_old_ones(table: Table) -> None:
    client = Client(table)
    table.touch(client.participant.person.key)
    table.arm.moves = True

    def wait(seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            table.wait(0.1)
            client.say(requests.Heartbeat)

    wait(1.0)
    assert moves(table)
    # It grows without silence.
    for _ in range(20):
        client.delay += 0.05
        wait(0.1)
    assert not moves(table)
    assert table.arm.cause is not None
    assert table.arm.cause.reason is Reason.DRIVER_SILENT
    beats = table.arm.beats
    wait(2.0 * PAUSE_TIMEOUT)
    # The driver is late and not gone, so nothing latches a stop, and the arm's process is not left.
    assert (table.arm.stops, table.hub.stopped) == (0, None)
    assert table.arm.beats > beats + 100


def test_late_drag_is_shown_and_not_followed_and_its_end_counts(table: Table) -> None:
    driver = table.join(PAGES[0])
    server = viser.ViserServer(port=0, verbose=False)

    async def drag() -> None:
        hooked = Hooked(table, server, driver)
        handle = server.scene.add_transform_controls("/target/move")

        @handle.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            actor = hooked.gestures.actor(event.client_id)
            if event.phase == "end":
                hooked.gestures.submit(cmd.EndDrag(), actor)
            elif event.phase == "update":
                hooked.gestures.submit(cmd.Position(np.asarray(event.target.position)), actor)

        async def say(message: Any, delay: float) -> list[str]:
            hooked.receive(delay)
            await hooked.handle(message)
            await asyncio.sleep(0.01)
            return [type(command).__name__ for command in table.arm.commands]

        name = "/target/move"
        assert await say(internals.drag(name, "start"), 2.0) == []
        assert "2.0 s late" in hooked.refusals[0]
        update = internals.drag(name, "update", 0.3, 0.0, 0.1)
        # The start was refused, so nothing follows.
        assert await say(update, 0.0) == []
        await say(internals.drag(name, "start"), 0.1)
        assert await say(update, 0.1) == ["Position"]
        assert await say(update, 2.0) == ["Position"]
        assert len(hooked.refusals) == 2
        assert (await say(internals.drag(name, "end"), 2.0))[-1] == "EndDrag"

    try:
        asyncio.run(drag())
    finally:
        internals.forget_clients(server)
        server.stop()


def test_time_of_a_message_of_viser_is_taken_from_it() -> None:
    server = viser.ViserServer(port=0, verbose=False)
    try:
        message_filter = MessageFilter(Guard(server), "a test", 0.0)
        server.scene.add_transform_controls("/move")
        start = {"type": "TransformControlsDragStartMessage", "name": "/move", "made": 12.5}
        result = message_filter.judge(msgspec.msgpack.encode(start), 0.0)
        assert (result.ruling, result.made) == (Ruling.PASS, 12.5)
        message = {"type": "Seen", "count": 3, "made": 13}
        result = message_filter.judge(msgspec.msgpack.encode(message), 0.0)
        assert (result.seen, result.made) == (3, 13)
        for stamp in (math.nan, math.inf, "now", [1.0]):
            result = message_filter.judge(msgspec.msgpack.encode({**start, "made": stamp}), 0.0)
            assert (result.ruling, result.message) == (Ruling.DROP, None)
    finally:
        server.stop()
