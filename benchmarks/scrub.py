"""Time from a request to the recorded state, anywhere in a recording of an hour.

    python -m benchmarks.scrub --minutes 60

The floor is what no reader can do without: reading the second of the file that holds the moment and
unpacking it, with the zstandard library alone. The result is also given as a multiple of it.
"""

from __future__ import annotations

import argparse
import random
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import zstandard

from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.playback.store import AnyRun, opened
from tests.recording.recorded import header, run

TICKS = 2000
"""Ticks that are simulated; the rest of the hour repeats them."""

ZSTD_MAGIC = zstandard.FRAME_HEADER

TARGET = 0.15
"""[s] Time that scrubbing may take."""


def write_run(path: Path, seconds: float, ticks: int = TICKS) -> None:
    """Write a recording of ``seconds`` of motion without a pause to ``path``."""
    records: list[TickRecord] = []
    run(ticks, 1, records.append, odd=False)
    span, shift = records[-1].t - records[0].t + 0.01, 0.0
    with path.open("wb") as file:
        writer = RecordingWriter(file, header())
        while shift < seconds:
            for number, each in enumerate(records):
                writer.put(_later(each, shift))
                if number % 100 == 0:
                    writer.flush()
            shift += span
        writer.close()


def _later(record: TickRecord, shift: float) -> TickRecord:
    """Return ``record`` later by ``shift`` [s]."""
    state = replace(record.state, t=record.state.t + shift)
    return record._replace(t_before=record.t_before + shift, t=record.t + shift, state=state)


def floors(path: Path, count: int) -> list[float]:
    """Return the times [s] to read and unpack single chunks of the file."""
    with path.open("rb") as file:
        content = file.read()
    begins, at = [], content.find(ZSTD_MAGIC)
    while at >= 0:
        begins.append(at)
        at = content.find(ZSTD_MAGIC, at + 4)
    found = []
    for begin in random.Random(5).sample(begins[:-1], count):
        length = begins[begins.index(begin) + 1] - begin
        began = time.perf_counter()
        with path.open("rb") as file:
            file.seek(begin)
            zstandard.ZstdDecompressor().decompressobj().decompress(file.read(length))
        found.append(time.perf_counter() - began)
    return found


def scrubs(played: AnyRun, count: int) -> list[float]:
    """Return the times [s] from a request to the state at random moments."""
    rng, found = random.Random(6), []
    start, end = played.spans[0].start, played.spans[-1].end
    for _ in range(count):
        t = rng.uniform(start, end)
        began = time.perf_counter()
        assert played.at(t) is not None
        found.append(time.perf_counter() - began)
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0, help="of the file (default: 60)")
    parser.add_argument("--count", type=int, default=300, help="moments (default: 300)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        write_run(path, 60.0 * options.minutes)
        began = time.perf_counter()
        played = opened(path)
        opening = time.perf_counter() - began
        found, floor = sorted(scrubs(played, options.count)), floors(path, options.count)
        size = path.stat().st_size / 1e6
    median, least = statistics.median(found), statistics.median(floor)
    print(f"{options.minutes:g} min, {size:.0f} MB, opened in {1e3 * opening:.0f} ms")
    high = found[-len(found) // 100 - 1]
    print(
        f"request to state: median {1e3 * median:.1f} ms, 99 % {1e3 * high:.1f} ms, "
        f"maximum {1e3 * found[-1]:.1f} ms (at most {1e3 * TARGET:g} ms)"
    )
    print(
        f"floor, one second read and unpacked: {1e3 * least:.2f} ms; the median is "
        f"{median / least:.0f} times it"
    )


if __name__ == "__main__":
    main()
