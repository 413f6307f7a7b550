"""The numbers of the form of the tool pose stay between their limits in every frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import viser

from katana450.arm.control.session.session import Session
from katana450.arm.robot.arm_reader import MountedArm
from katana450.server.view.controls import listener
from katana450.server.view.panel import PoseForm
from katana450.server.view.readout import BASE, SHOULDER
from katana450.server.viser_bridge.guard import Guard
from tests.view.gestures import RecordedGestures
from tests.viser_bridge import internals
from tests.waiting import until


@pytest.fixture
def form(server: viser.ViserServer, arm: MountedArm, session: Session) -> PoseForm:
    state = session.begin(session.ready, 0.0, 0.0)
    return PoseForm(server.gui, arm, listener(RecordedGestures()), state)


def control(server: viser.ViserServer, label: str) -> Any:
    (match,) = (handle for handle in internals.controls(server) if handle.label == label)
    return match


def choose_frame(server: viser.ViserServer, frame: str) -> None:
    """Choose ``frame`` and wait until the numbers are converted."""
    before = control(server, "x, y, z").value
    control(server, "Frame").value = frame
    until(lambda: control(server, "x, y, z").value != before, 10.0)


@pytest.mark.usefixtures("form")
def test_half_a_turn_is_allowed(server: viser.ViserServer) -> None:
    angles, guard = control(server, "r, p, y"), Guard(server)
    assert angles.value == pytest.approx((0.0, 25.0, 0.0))
    for value, allowed in ((180.0, True), (-180.0, True), (180.1, False)):
        change = internals.value_change(angles, (value, 0.0, 0.0))
        assert (guard.objection(change) is None) is allowed, value


@pytest.mark.usefixtures("form")
def test_a_position_beyond_the_limit_in_another_frame_can_be_edited(
    server: viser.ViserServer,
) -> None:
    position, guard = control(server, "x, y, z"), Guard(server)
    position.value = (0.0, 0.0, 1000.0)
    choose_frame(server, BASE)
    x, y, z = position.value
    assert z > 1000.0
    assert guard.objection(internals.value_change(position, (x + 400.0, y, z))) is None
    assert guard.objection(internals.value_change(position, (x, y, z + 100.0))) is not None
    choose_frame(server, SHOULDER)
    assert position.value == pytest.approx((0.0, 0.0, 1000.0))
    assert guard.objection(internals.value_change(position, (0.0, 0.0, 1002.0))) is not None


def test_numbers_are_the_goal_until_a_person_types(
    server: viser.ViserServer, form: PoseForm, session: Session
) -> None:
    position, angles = control(server, "x, y, z"), control(server, "r, p, y")
    states = [
        session.begin(session.ready + turn * np.eye(5)[0], 0.0, 0.0) for turn in (0.0, 0.3, 0.6)
    ]
    shown = []
    for state in states:
        form.set_controls(state)
        shown.append((position.value, angles.value))
    assert len(set(shown)) == 3
    position.value, angles.value = shown[0]
    form.set_controls(states[1])
    assert (position.value, angles.value) == shown[0]
    # Once the arm goes where the numbers say, they are its goal again.
    form.set_controls(states[0])
    form.set_controls(states[2])
    assert (position.value, angles.value) == shown[2]
