"""The numbers of the panel are computed again only when the state or the frame has changed."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
import viser

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.server.view import readout
from katana450.server.view.panel import Panel
from katana450.server.view.readout import PoseDisplay
from tests.view.gestures import RecordedGestures
from tests.viser_bridge import internals


def texts(server: viser.ViserServer) -> str:
    elements = internals.panel(server)
    return "".join(each.content for each in elements if isinstance(each, viser.GuiHtmlHandle))


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

    (frame,) = (each for each in internals.controls(server) if each.label == "Frame")
    frame.value = readout.BASE
    end = time.monotonic() + 10.0
    later = 6.0
    while "tcp in base" not in texts(server):
        assert time.monotonic() < end, "the numbers keep their frame"
        time.sleep(0.01)
        panel.follow(moved, later, caught_up=True)
        later += 1.0
    assert computed == [state, moved, moved]
