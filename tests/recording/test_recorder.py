"""A real server records its arm: identical when simulated again, through kills, within bounds."""

from __future__ import annotations

import asyncio
import json
import os
import random
import signal
import sys
import time
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest
from starlette.requests import Request

import katana450
from katana450.arm.control.lease import Role
from katana450.arm.runtime.tick import TickRecord
from katana450.cli.main import main
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.trimming import keep
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live import record_end, ring
from katana450.extensions.recording.live.job_process import JobReport
from katana450.extensions.recording.live.jobs import RecordingJob, RecordingRoutes
from katana450.extensions.recording.live.record_end import LostTicks, RecordDeserializer, RecordEnd
from katana450.extensions.recording.live.ring import Ring
from katana450.extensions.recording.messages import COMMANDS, EVENTS, STATE
from katana450.extensions.recording.playback.store import RecordingStore
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.service.identity import Identity
from katana450.server.web.http_api import RouteContext
from tests.browser.server import RECORDING_APP, AppServer, ServerError
from tests.conftest import LONG
from tests.gateway.client import ask, enter
from tests.recording.recorded import header, run
from tests.waiting import until

KILLS = 5 if LONG else 1
RECORDER = "katana450 rec"
MAX_LOSS = 1.1
"""[s] Maximum time at the end of a recording that a kill can lose."""

POSTURES = ((0.3, -1.0, 1.4, 0.3, 0.0), (-0.3, -1.0, 1.4, 0.3, 0.5))


def verified(path: Path) -> int:
    """Return the number of ticks of the recording, which is simulated again to the bit."""
    result = katana450.open(path).verify()
    assert result.identical, str(result)
    return result.ticks


def tick_times(path: Path) -> list[float]:
    with RecordingFile.open(path) as file:
        return [message.t for message in file.messages(COMMANDS)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "ring"


@pytest.fixture(scope="module")
def server_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("server") / "ring"


@pytest.fixture(scope="module")
def server(server_folder: Path) -> Iterator[AppServer]:
    """Return a server for two tests, the second of which kills the process that records."""
    # A busy machine delays the heartbeats of its processes, for which the arm would pause.
    with AppServer((*RECORDING_APP, "--silence", "2.0", "--record", str(server_folder))) as running:
        yield running


def test_motion_is_recorded_and_simulated_again_to_the_bit(
    server: AppServer, server_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = server_folder
    assert str(folder) in server.output
    if sys.platform != "win32":
        niceness = [os.getpriority(os.PRIO_PROCESS, pid) for pid in _pids(server)]
        # That of the arm, and that of the process that records.
        assert niceness[0] < niceness[1]
    with katana450.connect(server.url, name="test") as client:
        for posture in POSTURES:
            state = client.joints(posture)
        client.stop()
        copy = tmp_path / "kept.mcap"
        until(lambda: list(folder.glob("*")))
        # After the delay of its start, and then a second for the disk.
        until(lambda: main(["record", "keep", str(folder), "--out", str(copy)]) == 0)
        until(lambda: _keeps(folder, copy, "stop"))
        address, cookie = f"{server.url}/api/v1/recording", enter(server.url)
        for query, status in (("?last=0", 400), ("?last=x", 400), ("", 200)):
            answer = ask(address + query, Cookie=cookie)
            assert answer[0] == status, answer[2]
    downloaded = tmp_path / "downloaded.mcap"
    downloaded.write_bytes(answer[2])
    assert tick_times(downloaded) == tick_times(copy)
    assert verified(downloaded) > 100
    (path,) = recordings_in(folder)
    recording = katana450.open(copy)
    assert np.abs(recording.q - state.q).max(axis=1).min() < 1e-9
    # It begins with the first motion, although the process started later.
    assert recording.t[-1] - recording.t[0] > 1.0
    names = [type(command.command).__name__ for command in recording.commands]
    assert names.count("Joints") == len(POSTURES)
    assert "Stop" in names
    assert path.stat().st_mode & 0o077 == 0
    capsys.readouterr()


def _pids(server: AppServer) -> tuple[int, int]:
    """Return the ids of the arm's process and of the one that records."""
    until(partial(_other_child, server, 0))
    return server.arm, server.child(RECORDER)


def test_script_leaves_no_file_even_if_nobody_takes_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def made(job: RecordingJob) -> JobReport:
        (job._folder / "again.yaml").write_bytes(b"recorded")
        return JobReport(words="", file="again.yaml")

    monkeypatch.setattr(RecordingJob, "_result", made)
    who = Identity("session", "Ada", Role.OPERATOR)
    context = RouteContext(None, None, lambda _: who, None, None)  # type: ignore[arg-type]
    store = RecordingStore(folder)
    request = Request({"type": "http", "query_string": b"", "headers": []})
    answer = asyncio.run(RecordingRoutes(context, store).routes()[1].endpoint(request))
    assert answer.body == b"recorded"
    # The answer was not sent: the connection broke.
    assert not [path for path in store.new_path().parent.iterdir() if path.is_dir()]


def _keeps(folder: Path, copy: Path, command: str) -> bool:
    """Keep the ring in the file ``kept``; return whether it contains ``command``."""
    assert main(["record", "keep", str(folder), "--out", str(copy)]) == 0
    with RecordingFile.open(copy) as file:
        return any(f'"{command}"'.encode() in message.data for message in file.messages(COMMANDS))


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_killed_recorder_loses_a_second_and_the_arm_nothing(
    server: AppServer, server_folder: Path
) -> None:
    chance, folder = random.Random(450), server_folder
    with katana450.connect(server.url, name="test") as client:
        client.clear_stop()
        client.joints(POSTURES[1])
        until(lambda: recordings_in(folder))
        for kill in range(KILLS):
            before = recordings_in(folder)[-1]
            for posture in POSTURES:
                client.joints(posture)
            moved = time.perf_counter()
            # At rest: what was recorded until then is synced more or less far.
            time.sleep(chance.uniform(0.0, 1.0) if LONG else 0.0)
            recorder = server.child(RECORDER)
            os.kill(recorder, signal.SIGKILL)
            # The arm still follows commands while nothing records it.
            client.joints(POSTURES[kill % 2])
            until(partial(_other_child, server, recorder))
            client.joints(POSTURES[1 - kill % 2])
            until(partial(_has_newer, folder, before))
            broken = recordings_in(folder)[-2]
            # It has no end. What was synced a second before is there.
            assert verified(broken) > 0
            assert moved - tick_times(broken)[-1] <= MAX_LOSS
    server.stop()
    assert verified(recordings_in(folder)[-1]) > 0


def _other_child(server: AppServer, than: int) -> bool:
    """Return whether the server has a process that records, other ``than`` that of this id."""
    try:
        return server.child(RECORDER) != than
    except (ServerError, OSError):
        return False


def _has_newer(folder: Path, before: Path) -> bool:
    """Return whether ``folder`` has a recording after ``before``."""
    return recordings_in(folder)[-1] != before


def test_ring_keeps_the_newest_files(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ring, "MAX_FILE_TICKS", 10)
    monkeypatch.setattr(ring, "MAX_FILES", 5)
    store = Ring(folder, header())

    def put(record: TickRecord) -> None:
        store.put(record)
        store.sync()

    run(150, 5, put)
    store.close()
    files = recordings_in(folder)
    assert len(files) == ring.MAX_FILES
    # The first tick of a file is that of its complete state.
    assert verified(files[0]) == ring.MAX_FILE_TICKS - 1
    assert verified(files[-1]) > 0
    ends = [tick_times(path)[-1] for path in files]
    assert ends == sorted(ends)
    # No tick is missing between them.
    ticks = [t for path in files for t in tick_times(path)]
    assert max(after - before for before, after in pairwise(ticks)) < 0.1


def test_ticks_that_a_full_disk_did_not_take_are_counted(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    # A file stands where the folder should be.
    folder.write_text("in the way")
    now = [0.0]
    store = Ring(folder, header(), lambda: now[0])
    records: list[TickRecord] = []
    run(200, 6, records.append, odd=False)
    store.put_all(records[:20])
    assert "is interrupted" in caplog.text
    folder.unlink()
    # Not before the time of the next attempt.
    store.put(records[20])
    assert not folder.exists()
    now[0] = ring.RETRY_SECONDS
    # An arm at rest has no more ticks.
    store.sync()
    assert not store.problem
    assert not store.unsynced
    store.put_all(records[21:])
    store.close()
    (path,) = recordings_in(folder)
    assert content_of_ticks(path) == ([(21, "File exists")], [r.t for r in records[21:]])
    assert verified(path) == len(records) - 22


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process")
def test_ticks_of_a_failed_sync_are_counted_and_not_there_twice(folder: Path) -> None:
    """They were given to the file, but the sync failed; so did the next two files."""
    import resource  # noqa: PLC0415 - not on Windows

    now = [0.0]
    store = Ring(folder, header(), lambda: now[0])
    records: list[TickRecord] = []
    run(400, 6, records.append, odd=False)
    store.put_all(records[:100])
    store.sync()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for place in (100, 140, 180):
        now[0] += ring.RETRY_SECONDS
        store.put_all(records[place : place + 40])
        (*_, path) = recordings_in(folder)
        resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 100, before[1]))
        try:
            store.sync()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert "Nothing is recorded now" in store.problem
    now[0] += ring.RETRY_SECONDS
    store.put_all(records[220:260])
    store.close()
    joined = folder.with_name("joined.mcap")
    # Files that took nothing are gone, and no tick is there twice.
    assert len(recordings_in(folder)) == 2
    keep(folder, joined)
    gaps, times = content_of_ticks(joined)
    assert gaps == [(120, "File too large")]
    assert times == [record.t for record in (*records[1:100], *records[220:260])]
    result = katana450.open(joined).verify()
    assert result.identical
    assert result.unknown == 120


def content_of_ticks(path: Path) -> tuple[list[tuple[int, str]], list[float]]:
    """Return the number of ticks and the reason of each gap in ``path``, and times of ticks [s]."""
    with RecordingFile.open(path) as file:
        ticks = [json.loads(message.data) for message in file.messages(COMMANDS)]
    gaps = [
        (tick["ticks"], tick["missing"].removeprefix("The disk took nothing: ")[:-1])
        for tick in ticks
        if "missing" in tick
    ]
    return gaps, [tick["t"] for tick in ticks if "missing" not in tick]


def test_reader_that_hangs_costs_records_but_no_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_end, "MAX_WAITING", 50)
    ours, theirs = Pipe()
    sent: list[TickRecord] = []

    def take(record: TickRecord) -> None:
        sent.append(record)
        end.put(record)

    end = RecordEnd()
    # These wait for the pipe.
    run(20, 7, take)
    end.attach(ours)
    began = time.monotonic()
    # More than the pipe and the list hold, while nobody reads.
    run(1000, 7, take)
    assert time.monotonic() - began < 60.0
    end.close()
    deserializer, received, lost = RecordDeserializer(), list[TickRecord](), 0
    before_gap = 0
    while theirs.poll(20.0):
        try:
            message = theirs.recv_bytes()
        except EOFError:
            break
        records = deserializer.loaded(message)
        if isinstance(records, LostTicks):
            before_gap = before_gap or len(received)
            lost += records.ticks
        else:
            received += records
    assert lost > 0
    assert len(received) + lost == len(sent)
    assert received[0].t == sent[0].t
    # The same objects in every record in which they were the same before.
    same = [a.state.objects is b.state.objects for a, b in pairwise(received[:before_gap])]
    were = [a.state.objects is b.state.objects for a, b in pairwise(sent[:before_gap])]
    assert same == were


def test_ticks_are_sent_in_batches_and_the_last_ones_soon() -> None:
    ours, theirs = Pipe()
    end, records = RecordEnd(), list[TickRecord]()
    run(2 * record_end.BATCH + 3, 9, records.append)
    for record in records[:-3]:
        end.put(record)
    end.attach(ours)
    deserializer = RecordDeserializer()

    def batch() -> list[TickRecord]:
        records = deserializer.loaded(theirs.recv_bytes())
        assert not isinstance(records, LostTicks)
        return records

    batches = [batch() for _ in range(2)]
    assert list(map(len, batches)) == [record_end.BATCH] * 2
    # After a motion nothing comes that fills the batch.
    for record in records[-3:]:
        end.put(record)
    received = [record for some in batches for record in some]
    while len(received) < len(records):
        assert theirs.poll(4 * record_end.COLLECTING), "the last ticks were not sent"
        received += batch()
    assert [record.t for record in received] == [record.t for record in records]
    end.close()


def test_batches_are_written_as_single_ticks_are(folder: Path) -> None:
    records: list[TickRecord] = []
    run(200, 9, records.append)
    written, places = [], list[FloatArray]()
    for name in ("alone", "together"):
        store = Ring(folder / name, header())
        for start in range(0, len(records), record_end.BATCH):
            batch = records[start : start + record_end.BATCH]
            if name == "together":
                store.put_all(batch)
            else:
                for record in batch:
                    store.put(record)
        store.close()
        (path,) = recordings_in(folder / name)
        with RecordingFile.open(path) as file:
            written.append([message[:3] for message in file.messages(COMMANDS, EVENTS, STATE)])
            states = [json.loads(message.data) for message in file.messages(STATE)]
        places.append(np.array([state["position"] for state in states]))
    assert written[0] == written[1]
    assert len(places[0]) > 100
    assert np.abs(places[0] - places[1]).max() < 2e-6
