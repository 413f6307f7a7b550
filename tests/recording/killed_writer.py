"""A process that writes a recording until it is killed, and prints the time of each synced part.

The first argument is a file of pickled records, which the test has made, the second the recording.
"""

from __future__ import annotations

import os
import pickle
import sys
import time
from dataclasses import replace
from pathlib import Path

from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.files.recording_writer import RecordingWriter

SPEED = 10.0
"""Ratio of the time of the recording to that of the clock."""

SYNC_PERIOD = 1.0
"""[s] Time of the recording between two syncs."""


def main(given: Path, target: Path) -> None:
    header, records = pickle.loads(given.read_bytes())
    length = records[-1].t - records[0].t + 0.01
    with target.open("wb") as file:
        writer = RecordingWriter(file, header)
        begun = time.monotonic()
        synced = shift = 0.0
        while True:
            for each in records:
                tick: TickRecord = each._replace(
                    t=each.t + shift,
                    t_before=each.t_before + shift,
                    state=replace(each.state, t=each.state.t + shift),
                )
                writer.put(tick)
                print(f"put {tick.t!r}", flush=True)
                if tick.t - synced >= SYNC_PERIOD:
                    writer.flush()
                    os.fsync(file.fileno())
                    synced = tick.t
                    print(f"synced {tick.t!r}", flush=True)
                ahead = (tick.t - records[0].t) / SPEED - (time.monotonic() - begun)
                time.sleep(max(ahead, 0.0))
            shift += length


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
