"""A server whose recording has a full disk: nothing waits, and the recording says what is lost."""

from __future__ import annotations

import json
import resource
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.cli.main import main
from katana450.client import RefusedError, connect
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live import ring
from katana450.extensions.recording.messages import COMMANDS
from katana450.server.api import answers, requests
from tests.browser.server import RECORDING_APP, AppServer, ServerError
from tests.recording.recorded import PERIOD
from tests.recording.test_recorder import POSTURES, RECORDER, tick_times
from tests.waiting import until


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "ring"


def command(folder: Path) -> tuple[str, ...]:
    return (*RECORDING_APP, "--silence", "2.0", "--record", str(folder))


@contextmanager
def swinging(server: AppServer) -> Iterator[None]:
    """Turn the arm to and fro without a rest inside the block."""
    ended = threading.Event()

    def swing() -> None:
        with connect(server.url, "Ada") as arm:
            for number in range(10_000):
                with suppress(RefusedError):
                    arm.ask(requests.Joints(q=np.array(POSTURES[number % 2])))
                if ended.wait(0.6):
                    break

    thread = threading.Thread(target=swing)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def recorder(server: AppServer) -> int | None:
    """Return the id of the process that records; None while there is none."""
    with suppress(ServerError, OSError):
        return server.child(RECORDER)
    return None


def written_times(path: Path) -> list[float]:
    """Return the times of the ticks in ``path``, which may have no end yet."""
    with suppress(katana450.InputError):
        return tick_times(path)
    return []


def gaps_of(path: Path) -> list[tuple[float, int, str]]:
    """Return length [s], number of ticks and reason of each gap in ``path``."""
    before, gaps = 0.0, []
    with RecordingFile.open(path) as file:
        for message in file.messages(COMMANDS):
            content = json.loads(message.data)
            if "missing" in content:
                gaps.append((content["t"] - before, content["ticks"], content["missing"]))
            before = content["t"]
    return gaps


@pytest.mark.long
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of other processes")
def test_full_disk_delays_no_tick_and_is_reported(folder: Path, tmp_path: Path) -> None:
    with AppServer(command(folder)) as server, swinging(server):
        until(lambda: recordings_in(folder), 60.0)
        first = recordings_in(folder)[0]
        until(lambda: written_times(first), 60.0)
        process = recorder(server)
        assert process is not None
        # The disk takes no file of this size any more.
        resource.prlimit(process, resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
        until(lambda: "is interrupted" in server.output, 60.0)
        with connect(server.url, "Look") as look:
            time.sleep(1.0)
            begin = look.query(answers.State)
            time.sleep(ring.RETRY_SECONDS)
            end, timing = look.query(answers.State), look.query(answers.Loop)
        assert end.t - begin.t > 0.8 * ring.RETRY_SECONDS
        assert timing.late_p50 < PERIOD
        resource.prlimit(process, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
        newest = recordings_in(folder)[-1].name

        def again() -> bool:
            last = recordings_in(folder)[-1]
            return last.name > newest and bool(written_times(last))

        until(again, 60.0)
        whole = tmp_path / "kept.mcap"
        assert main(["record", "keep", str(folder), "--out", str(whole)]) == 0
        assert "is interrupted: File too large" in server.output
    ((length, ticks, why),) = gaps_of(whole)
    assert ticks == pytest.approx(length / PERIOD, rel=0.1)
    assert why == "The disk took nothing: File too large."
    assert katana450.open(whole).verify().identical
