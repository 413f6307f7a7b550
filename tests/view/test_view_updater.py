"""Panel and scene: neither waits for the other, and numbers are computed only after a change."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.pipes.state_publisher import LoopTiming, Snapshot, StatePublisher
from katana450.server.view import readout
from katana450.server.view.panel import Panel
from katana450.server.view.readout import PoseDisplay
from katana450.server.view.view import ViewUpdater
from tests.view.gestures import RecordedGestures
from tests.viser_bridge import internals
from tests.waiting import until

FRAME_RATE = 10.0


class Noting(ViewUpdater):
    """A view that notes what it shows, and when."""

    def __init__(self, server: viser.ViserServer, publisher: StatePublisher) -> None:
        super().__init__(server, publisher, FRAME_RATE)
        self.noted: list[tuple[str, int, float]] = []

    def show(self, snapshot: Snapshot) -> None:
        self.noted.append(("scene", snapshot.ticket, time.perf_counter()))

    def show_panel(self, snapshot: Snapshot) -> None:
        self.noted.append(("panel", snapshot.ticket, time.perf_counter()))

    def of(self, ticket: int) -> list[tuple[str, float]]:
        """Return what was shown of the snapshot with ``ticket``."""
        return [(what, t) for what, number, t in [*self.noted] if number == ticket]


@pytest.fixture
def publisher(session: Session) -> StatePublisher:
    return StatePublisher(Snapshot(session.begin(session.ready, 0.0, 0.0), 0), LoopTiming(0.01))


@pytest.fixture
def view(server: viser.ViserServer, publisher: StatePublisher) -> Iterator[Noting]:
    view = Noting(server, publisher)
    view.start()
    yield view
    view.stop()
    assert not view.failed.is_set()


def wait_for(view: Noting, ticket: int, count: int) -> list[tuple[str, float]]:
    until(lambda: len(view.of(ticket)) >= count, 10.0)
    return view.of(ticket)


def test_panel_follows_half_a_frame_after_the_scene(
    view: Noting, publisher: StatePublisher
) -> None:
    time.sleep(2.0 / FRAME_RATE)
    publisher.publish(Snapshot(publisher.snapshot.state, 1))
    (scene, shown), (panel, followed), *_ = wait_for(view, 1, 2)
    assert (scene, panel) == ("scene", "panel")
    assert followed - shown >= 0.45 / FRAME_RATE


def test_command_is_shown_at_once_and_leaves_the_panel_its_turn(
    view: Noting, publisher: StatePublisher
) -> None:
    state = publisher.snapshot.state
    time.sleep(2.0 / FRAME_RATE)
    # Faster than frames, as a program streams targets.
    for ticket in range(1, 41):
        publisher.publish(Snapshot(state, ticket))
        time.sleep(0.1 / FRAME_RATE)
    wait_for(view, 40, 2)
    shown = {ticket for what, ticket, _ in view.noted if what == "scene"}
    followed = {ticket for what, ticket, _ in view.noted if what == "panel"}
    # Each frame that was shown has its panel: commands never keep it back.
    assert shown == followed
    assert 40 in shown
    assert len(shown) > 10


def texts(server: viser.ViserServer) -> str:
    elements = internals.panel(server)
    return "".join(
        element.content for element in elements if isinstance(element, viser.GuiHtmlHandle)
    )


def test_numbers_follow_state_and_frame_and_cost_nothing_at_rest(
    server: viser.ViserServer, robot: Robot, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed: list[State] = []
    page = readout.page

    def noted(arm: MountedArm, state: State, display: PoseDisplay) -> str:
        computed.append(state)
        return page(arm, state, display)

    monkeypatch.setattr(readout, "page", noted)
    state = session.begin(session.ready, 0.0, 0.0)
    panel = Panel(server, robot, RecordedGestures(), session.choices, state)
    for now in range(5):
        panel.follow(state, float(now), caught_up=True)
    assert computed == [state]
    shown = texts(server)
    assert "<td class='unit'>mm</td>" in shown

    moved = replace(state, q=state.q + np.radians(1.0))
    panel.follow(moved, 5.0, caught_up=True)
    assert computed == [state, moved]
    assert texts(server) != shown

    (frame,) = (handle for handle in internals.controls(server) if handle.label == "Frame")
    frame.value = readout.BASE
    end = time.monotonic() + 10.0
    later = 6.0
    while "tcp in base" not in texts(server):
        assert time.monotonic() < end, "the numbers keep their frame"
        time.sleep(0.01)
        panel.follow(moved, later, caught_up=True)
        later += 1.0
    assert computed == [state, moved, moved]
