"""Squeeze and slip in recordings, and the touch by the names of nodes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from katana450.arm.control.commands import commands as cmd
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
            # Too little for the weight of the rod.
            yield cmd.Gripper(state.grip - 0.004)
        elif tick == 170:
            yield cmd.Joint(2, state.q[1] - 0.1)

    path = record_session(tmp_path / "slip.mcap", 320, commands)
    assert len({state.squeeze for state in states}) == 3
    sliding = [s for s in states if any(finding.reason is Reason.SLIDING for finding in s.findings)]
    places = {s.held.T.tobytes() for s in sliding if s.held is not None}
    assert len(places) == len(sliding) > 20, "it slides in each tick"
    with RecordingFile.open(path) as file:
        result = verify_recording(file, fresh().session)
    assert result.identical, result
    assert result.ticks > 150
