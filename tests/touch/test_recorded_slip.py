"""Forces of the fingers and slip in recordings."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.grip import contacts_of
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import Reason, State
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import verify_recording
from tests.control.test_grip import OPEN
from tests.recording.recorded import fresh
from tests.recording.sessions import record_session

ROD = SceneObject(
    "rod",
    Shape.CYLINDER,
    (0.015, 0.31),
    np.array(((1, 0, 0, 0.4477), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1.0))),
    can_be_held=True,
)
"""A rod on the table between the open fingers in the ready posture."""


def test_grip_and_slip_are_identical_to_the_bit_in_a_recording(tmp_path: Path) -> None:
    states: list[State] = []

    def commands(tick: int, state: State) -> Iterator[cmd.Command]:
        states.append(state)
        if tick == 0:
            yield cmd.Gripper(OPEN)
        elif tick == 60:
            yield cmd.PlaceObject(ROD)
            yield cmd.Gripper(-0.44)
        elif tick == 160:
            assert state.grip is not None
            # So little force that the moving hand loses the rod.
            yield cmd.Gripper(state.grip - 0.01)
        elif tick == 170:
            yield cmd.Joint(2, state.q[1] - 0.1)

    path = record_session(tmp_path / "slip.mcap", 320, commands)
    assert max(state.squeeze for state in states[:160]) > 0.05
    assert states[165].squeeze == pytest.approx(0.01)
    reasons = {finding.reason for state in states for finding in state.findings}
    assert Reason.SLIPPED in reasons
    forces = {contact.force for state in states for contact in contacts_of(state)}
    assert len(forces) > 20, "they change while the rod slips"
    with RecordingFile.open(path) as file:
        result = verify_recording(file, fresh().session)
    assert result.identical, result
    assert result.ticks > 150
