"""An hour of motion without a pause takes at most 62 MB."""

from __future__ import annotations

from pathlib import Path

import pytest

from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from tests.conftest import LONG
from tests.recording.recorded import (
    PERIOD,
    Commands,
    dragging,
    header,
    random_commands,
    run,
    swinging,
)

TICKS = 6000 if LONG else 660
"""Ticks of a minute, as in a file of a server, or fewer."""


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("commands", "seed"),
    [
        (swinging, 1),
        (dragging, 1),
        # It follows a plan to and fro with a full cup in the hand.
        pytest.param(random_commands, 2, marks=pytest.mark.long),
    ],
)
def test_hour_without_a_pause_takes_at_most_62_mb(
    tmp_path: Path, commands: Commands, seed: int
) -> None:
    path = tmp_path / "hour.mcap"
    sizes: list[int] = []
    with path.open("wb") as opened:
        writer = RecordingWriter(opened, header())
        records: list[TickRecord] = []
        run(TICKS, seed, records.append, commands, odd=False)
        for number, record in enumerate(records):
            writer.put(record)
            # As often as a server syncs.
            if number % 60 == 59:
                writer.flush()
                sizes.append(opened.tell())
        writer.close()
    # Beginning and end of a file; a server begins another one each minute.
    fixed = sizes[0] + path.stat().st_size - sizes[-1]
    minutes = PERIOD * 60 * (len(sizes) - 1) / 60.0
    assert 60.0 * ((sizes[-1] - sizes[0]) / minutes + fixed) < 62e6
