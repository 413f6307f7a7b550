"""A server whose recording is killed in mid-motion, hangs, or has a full disk: nothing waits."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.cli.main import main
from katana450.client import RefusedError, connect
from katana450.extensions.recording.files.keeping import whole_copy
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live import ring
from katana450.extensions.recording.messages import COMMANDS
from katana450.server.api import answers, requests
from tests.browser.server import RECORDING_APP, AppServer, ServerError
from tests.recording.recorded import PERIOD
from tests.recording.test_recorder import POSTURES, RECORDER, tick_times
from tests.waiting import until

SMALL_DISK = 'mount -t tmpfs -o size=1m none {folder} && exec "$@"'
"""Command of a shell that begins with a disk of 1 MB at a folder."""


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


def whole_times(path: Path, copy: Path) -> list[float]:
    """Return the times of the ticks in ``path``, which may have no end yet."""
    file = whole_copy(path, copy)
    if file is None:
        return []
    with suppress(katana450.InputError):
        return tick_times(file)
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


def mounted(folder: Path, line: tuple[str, ...]) -> tuple[str, ...] | None:
    """Return ``line`` with a disk of 1 MB at ``folder``; None where that is not allowed."""
    folder.mkdir()
    command = ("unshare", "-rm", "sh", "-c", SMALL_DISK.format(folder=folder), "sh")
    with suppress(OSError):
        if subprocess.run([*command, "true"], capture_output=True, check=False).returncode == 0:
            return (*command, *line)
    return None


@pytest.mark.long
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of other processes")
@pytest.mark.parametrize("disk", ["full", "limited"])
def test_full_disk_delays_and_loses_no_tick_and_is_reported(
    folder: Path, tmp_path: Path, disk: str
) -> None:
    line = command(folder)
    if disk == "full":
        on_disk = mounted(folder, line)
        if on_disk is None:
            pytest.skip("no file system can be mounted here; `limited` shows the same")
        line = on_disk
    with AppServer(line) as server, swinging(server):
        inside = Path(f"/proc/{server.pid}/root/{folder}")
        until(lambda: recordings_in(inside), 60.0)
        first, copy = recordings_in(inside)[0], tmp_path / "copy.mcap"
        until(lambda: whole_times(first, copy), 60.0)
        process = recorder(server)
        assert process is not None
        fill, free = actions(disk, process, inside)
        fill()
        until(lambda: "is interrupted" in server.output, 60.0)
        with connect(server.url, "Look") as look:
            time.sleep(1.0)
            begin = look.query(answers.State)
            time.sleep(ring.RETRY_SECONDS)
            end, timing = look.query(answers.State), look.query(answers.Loop)
        assert end.t - begin.t > 0.8 * ring.RETRY_SECONDS
        assert timing.late_p50 < PERIOD
        free()
        newest = recordings_in(inside)[-1].name

        def again() -> bool:
            last = recordings_in(inside)[-1]
            return last.name > newest and bool(whole_times(last, copy))

        until(again, 60.0)
        whole = tmp_path / "kept.mcap"
        assert main(["record", "keep", str(inside), "--out", str(whole)]) == 0
        reason = {"full": "No space left on device", "limited": "File too large"}[disk]
        assert f"is interrupted: {reason}" in server.output
    # The ticks of 30 s wait in memory.
    assert gaps_of(whole) == []
    assert katana450.open(whole).verify().identical


def actions(
    disk: str, process: int, folder: Path
) -> tuple[Callable[[], object], Callable[[], object]]:
    """Return what fills the disk of ``folder`` for ``process``, and what frees it again."""
    if disk == "full":
        filler = folder / "filler"

        def fill() -> None:
            with suppress(OSError), filler.open("wb", buffering=0) as file:
                while True:
                    file.write(bytes(4096))

        return fill, filler.unlink
    unlimited = resource.RLIM_INFINITY
    limit = partial(resource.prlimit, process, resource.RLIMIT_FSIZE)
    return partial(limit, (1000, unlimited)), partial(limit, (unlimited, unlimited))
