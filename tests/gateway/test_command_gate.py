"""Test the command gate: lease, stop and age of a gesture, with viser's hook and with threads."""

from __future__ import annotations

import ast
import asyncio
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
import viser

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import SERVER, Actor, Grounds, Role
from katana450.arm.control.state.state import Finding, Reason
from katana450.errors import LeaseError
from katana450.server.service.hub import TICK
from katana450.server.service.participants import Participant
from katana450.server.view.controls import listener
from katana450.server.viser_bridge.frames import FrameSlot, Stamp
from katana450.server.viser_bridge.gestures import Gestures, _Browser
from katana450.server.viser_bridge.guard import Guard
from tests.browser.server import free_port
from tests.gateway.test_hub import PAGES, FakeArm, Table
from tests.viser_bridge import internals

CLIENT = 7


def test_actor_travels_with_its_grounds(table: Table) -> None:
    first, second = (table.join(page, Role.OPERATOR) for page in PAGES)
    hub, arm = table.hub, table.arm
    hub.move(first, cmd.Home())
    hub.move(first, cmd.Home())
    hub.stop(second.actor)
    hub.move(first, cmd.ClearStop())
    hub.release_lease(first)
    assert [(actor.name, actor.grounds) for actor in arm.actors] == [
        ("Window 1", Grounds.FREE_LEASE),
        ("Window 1", Grounds.LEASE),
        ("Window 2", Grounds.SAFETY),
        ("Window 1", Grounds.LEASE),
        ("Window 1", Grounds.LEASE),
    ]


def test_findings_that_begin_and_end_are_noted_once(table: Table) -> None:
    table.hub.recorder.enabled = True
    limit = Finding(Reason.AXIS_LIMIT, 0.5, axis=1)
    contact = Finding(Reason.CONTACT, 0.006, parts=("finger_left_link", "table"))
    rest = table.arm.rest
    for findings in ((limit,), (limit, contact), (contact,), (contact,), ()):
        table.arm.rest = replace(rest, findings=findings)
        table.wait(TICK)
    notes = table.hub.recorder.notes
    entries = []
    while not notes.empty():
        note = notes.get_nowait()
        if note is not None and note.kind == "finding":
            entries.append((note.what.finding, note.what.began))
    assert entries == [(limit, True), (contact, True), (limit, False), (contact, False)]


def test_server_may_stop_hold_and_slow_but_not_move(table: Table) -> None:
    gate = table.hub.gate
    with pytest.raises(LeaseError, match="may not move"):
        gate.submit(cmd.Home(), SERVER)
    gate.submit(cmd.Speed(0.5), SERVER)
    gate.submit(cmd.Hold(), SERVER)
    assert (table.arm.fraction, table.arm.holds, table.hub.lease.holder) == (0.5, 1, None)


def test_gesture_from_before_a_stop_is_refused_after_clear_stop(table: Table) -> None:
    driver = table.join(PAGES[0])
    gesture = table.touch(driver.person.key)
    table.stop("Vera")
    with pytest.raises(LeaseError, match="stopped"):
        table.hub.gate.submit(cmd.Home(), gesture)
    table.hub.move(driver, cmd.ClearStop())
    with pytest.raises(LeaseError, match="Do it again"):
        table.hub.gate.submit(cmd.Home(), gesture)
    assert table.arm.commands == []
    table.hub.gate.submit(cmd.Home(), table.touch(driver.person.key))
    assert table.arm.commands == [cmd.Home()]


def test_gesture_from_before_a_lost_lease_acquires_no_lease(table: Table) -> None:
    driver = table.join(PAGES[0])
    gesture = table.touch(driver.person.key)
    table.hub.release_lease(driver)
    with pytest.raises(LeaseError, match="Do it again"):
        table.hub.gate.submit(cmd.Home(), gesture)
    assert table.hub.lease.holder is None


def test_no_gesture_of_another_thread_passes_a_stop(table: Table) -> None:
    """Every stop before an accepted command was made before the receipt of its gesture."""
    driver = table.join(PAGES[0])
    gate, done = table.hub.gate, threading.Event()

    class RecordingArm(FakeArm):
        def __init__(self) -> None:
            super().__init__(table.arm.rest)
            self.order: list[tuple[cmd.Command, Actor]] = []

        def deliver(self, command: cmd.Command, actor: Actor) -> int:
            self.order.append((command, actor))
            return super().deliver(command, actor)

    arm = RecordingArm()
    gate.arm = cast(Any, arm)

    def gesture() -> None:
        while not done.is_set():
            try:
                gate.submit(cmd.Home(), table.touch(driver.person.key))
            except LeaseError:
                continue

    threads = [threading.Thread(target=gesture) for _ in range(2)]
    for thread in threads:
        thread.start()
    for _ in range(1000):
        table.stop("Vera")
        table.hub.move(driver, cmd.ClearStop())
    done.set()
    for thread in threads:
        thread.join()
    stops = moves = 0
    stopped = False
    for command, actor in arm.order:
        match command:
            case cmd.Stop():
                stops, stopped = stops + 1, True
            case cmd.ClearStop():
                stopped = False
            case _:
                moves += 1
                assert not stopped
                assert actor.seen == stops
    assert stops == 1000
    assert moves > 0


class Hooked:
    """The hook of viser for one browser of a window, without the gateway's end of its socket."""

    def __init__(self, table: Table, server: viser.ViserServer, participant: Participant) -> None:
        self.gate = table.hub.gate
        self.gestures = Gestures(server, Guard(server), table.hub)
        self.corrections: list[Any] = []
        self.refusals: list[str] = []
        self.slot = FrameSlot(participant.person.key, self.refusals.append)
        connection: Any = SimpleNamespace(queue_message=self.corrections.append)
        self.gestures._browsers[CLIENT] = _Browser(connection, self.slot)
        client: Any = SimpleNamespace(add_notification=lambda *_, **__: None)
        internals.pretend_client(server, CLIENT, client)

    def receive(self, delay: float = 0.0) -> None:
        """Receive a message in the gateway and pass it on."""
        self.slot.stamps.append(Stamp(self.gate.revocations, delay))

    async def handle(self, message: Any) -> None:
        """Handle the message in viser."""
        await self.gestures._handle(CLIENT, message)
        await asyncio.sleep(0)


@pytest.fixture
def viser_server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(port=free_port(), verbose=False)
    yield server
    internals.forget_clients(server)
    server.stop()


async def test_message_that_waits_in_visers_socket_during_a_stop_changes_nothing(
    table: Table, viser_server: viser.ViserServer
) -> None:
    """The slider moves before STOP and clear, and viser handles the message after both."""
    driver = table.join(PAGES[0])
    hooked = Hooked(table, viser_server, driver)
    slider = viser_server.gui.add_slider("S", min=0.0, max=1.0, step=0.1, initial_value=0.0)
    listener(hooked.gestures)(slider, lambda: cmd.Joint(1, slider.value))
    moved = internals.value_change(slider, 0.5)
    hooked.receive()
    table.stop("Vera")
    table.hub.move(driver, cmd.ClearStop())
    await hooked.handle(moved)
    assert (table.arm.commands, slider.value) == ([], 0.0)
    assert "Do it again" in hooked.refusals[0]
    # The window gets the true value.
    (correction,) = hooked.corrections
    assert correction.updates == {"value": 0.0}
    hooked.receive()
    await hooked.handle(moved)
    assert table.arm.commands == [cmd.Joint(1, 0.5)]
    assert table.arm.actors[-1].name == driver.person.name
    assert table.arm.actors[-1].grounds is Grounds.LEASE


def test_event_of_a_browser_without_a_gesture_has_no_actor(
    table: Table, viser_server: viser.ViserServer
) -> None:
    gestures = Gestures(viser_server, Guard(viser_server), table.hub)
    for client_id in (None, CLIENT):
        with pytest.raises(LeaseError, match="start page"):
            gestures.actor(client_id)


def test_command_counts_though_a_callback_after_its_delivery_fails(
    table: Table, caplog: pytest.LogCaptureFixture
) -> None:
    gate, driver = table.hub.gate, table.join(PAGES[0])
    noted: list[cmd.Command] = []

    def fail(*_: object) -> None:
        raise RuntimeError("The callback fails.")

    gate.delivered += [fail, lambda command, *_: noted.append(command)]
    before = gate.motions
    table.hub.move(driver, cmd.Home())
    assert table.arm.commands == [cmd.Home()]
    assert gate.motions == before + 1
    assert noted == [cmd.Home()]
    assert "The callback fails." in caplog.text


PACKAGE = Path(katana450.__file__).parent

DELIVERIES = {
    ("server/service/command_gate.py", "self.arm"),
    ("server/service/command_gate.py", "arm"),
    # Behind the gate the handle passes commands on; the worker also adds the planned path.
    ("server/service/arm_handle.py", "self._sink"),
    ("arm/runtime/planning_worker.py", "self._arm"),
}
"""Files, and the objects to which they deliver commands."""


def uses(name: str) -> set[tuple[str, str]]:
    """Return each file that uses the attribute ``name``, with the object that has it."""
    texts = {path: path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")}
    return {
        (path.relative_to(PACKAGE).as_posix(), ast.unparse(node.value))
        for path, text in texts.items()
        if name in text
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Attribute) and node.attr == name
    }


def test_only_the_gate_delivers_commands() -> None:
    assert uses("deliver") == DELIVERIES


def test_only_the_front_end_makes_command_messages() -> None:
    makers = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if "CommandMessage(" in path.read_text(encoding="utf-8")
    }
    assert makers == {"arm/runtime/pipes/front_end.py"}
