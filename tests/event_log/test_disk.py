"""Test that a full, missing or stuck disk neither delays nor ends the server."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from katana450.client import connect
from katana450.extensions.event_log.disk_log import MAX_KEPT, LogWriter
from katana450.extensions.event_log.folder import LogFolder
from katana450.extensions.event_log.records import Record, record
from katana450.server.api import requests
from tests.browser.server import APP, AppServer
from tests.event_log.logs import CLOSING, numbered, records

FIRST = "events-000000000001.jsonl"

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such devices")


def wait(until: Callable[[], object], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not until():
        assert time.monotonic() < end
        time.sleep(0.02)


def full(folder: Path) -> Path:
    """Return the first file of a log in ``folder``, on a device that is always full."""
    folder.mkdir()
    (folder / FIRST).symlink_to("/dev/full")
    return folder / FIRST


def test_writer_continues_when_a_full_disk_has_room_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "log"
    device = full(folder)
    writer = LogWriter(folder)
    with caplog.at_level(logging.WARNING, "katana450"):
        for content in numbered(MAX_KEPT + 50):
            writer.put(content)
        wait(lambda: caplog.records)
        time.sleep(2.5)
        (entry,) = caplog.records
        assert "cannot be written: No space left on device" in entry.getMessage()
        device.unlink()
        wait(lambda: writer.seq == MAX_KEPT + 1)
        wait(lambda: "is written again" in caplog.text)
    writer.close(record("end"), CLOSING)
    *kept, lost, end = records(folder)
    assert [each["what"]["value"] for each in kept] == list(range(MAX_KEPT))
    assert (lost["kind"], lost["what"]["count"], end["kind"]) == ("lost", 50, "end")
    assert "No space left" in lost["why"]


def test_lost_records_stand_between_those_before_and_after_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    written, room = LogFolder.append, [0]

    def append(folder: LogFolder, content: Record) -> None:
        if not room[0]:
            raise OSError(28, "No space left on device")
        room[0] -= 1
        written(folder, content)

    monkeypatch.setattr(LogFolder, "append", append)
    writer = LogWriter(tmp_path)
    *early, late = numbered(MAX_KEPT + 6)
    for content in early:
        writer.put(content)
    wait(lambda: caplog.records)
    time.sleep(0.2)
    room[0] = 100
    wait(lambda: not room[0])
    writer.put(late)
    time.sleep(0.2)
    room[0] = MAX_KEPT
    wait(lambda: writer.seq == MAX_KEPT + 1)
    writer.close(record("end"), CLOSING)
    *kept, lost, end = records(tmp_path)
    assert [each["what"]["value"] for each in kept] == list(range(MAX_KEPT))
    assert (lost["kind"], lost["what"]["count"], end["kind"]) == ("lost", 6, "end")


def test_record_that_cannot_be_written_is_counted(tmp_path: Path) -> None:
    writer = LogWriter(tmp_path)
    writer.put(record("command", object()))
    time.sleep(0.2)
    writer.put(record("start"))
    writer.close(record("end"), CLOSING)
    lost, start, end = records(tmp_path)
    assert (lost["what"]["count"], start["kind"], end["kind"]) == (1, "start", "end")


def test_deleted_log_begins_again(tmp_path: Path) -> None:
    folder = tmp_path / "log"
    writer = LogWriter(folder)
    writer.put(record("start"))
    wait(lambda: writer.seq == 1)
    for path in folder.iterdir():
        path.unlink()

    def written() -> bool:
        writer.put(record("command"))
        time.sleep(0.3)
        return (folder / "claim").exists()

    wait(written)
    writer.close(record("end"), CLOSING)
    seqs = [each["seq"] for each in records(folder)]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
    assert seqs[0] > 1


def test_second_writer_of_a_folder_waits_for_the_first(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first, second = LogWriter(tmp_path), None
    first.put(record("start"))
    wait(lambda: first.seq == 1)
    second = LogWriter(tmp_path)
    second.put(record("start"))
    wait(lambda: "another server writes there" in caplog.text)
    first.close(record("end"), CLOSING)
    # The place is free now.
    second.close(record("end"), CLOSING)
    assert [each["kind"] for each in records(tmp_path)] == ["start", "end", "start", "end"]


def test_server_drives_and_stops_while_the_disk_is_full(tmp_path: Path) -> None:
    folder = tmp_path / "log"
    device = full(folder)
    with AppServer((*APP, "--log", str(folder))) as server, connect(server.url, "Anna") as arm:
        arm.go(requests.Joint(axis=1, value=0.1))
        arm.ask(requests.Stop())
        assert server.output.count("cannot be written") == 1
        device.unlink()
        wait(lambda: "is written again" in server.output)
        arm.clear_stop()
    assert {"start", "command", "stop", "clear", "end"} <= {
        each["kind"] for each in records(folder)
    }


@pytest.mark.long
def test_server_drives_stops_and_ends_while_the_disk_is_stuck(tmp_path: Path) -> None:
    """Give the log a pipe without a reader: opening it for writing never returns."""
    os.mkfifo(tmp_path / FIRST)
    with AppServer((*APP, "--log", str(tmp_path)), seconds=30.0) as server:
        with connect(server.url, "Anna") as arm:
            arm.go(requests.Joint(axis=1, value=0.1))
            delays = []
            for _ in range(20):
                began = time.perf_counter()
                arm.ask(requests.Stop())
                delays.append(time.perf_counter() - began)
                arm.clear_stop()
        assert sorted(delays)[10] < 0.1
        server.stop()
        assert not server.running


@pytest.mark.long
def test_server_runs_where_the_log_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with (
        AppServer((*APP, "--log", str(tmp_path / "file" / "log"))) as server,
        connect(server.url, "Anna") as arm,
    ):
        arm.ask(requests.Stop())
        assert server.output.count("cannot be written") == 1
        assert "Not a directory" in server.output


@pytest.mark.long
def test_option_no_log_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with AppServer((*APP, "--no-log")) as server:
        assert "Event log" not in server.output
    assert list(tmp_path.iterdir()) == []
    with AppServer() as server:
        folder = tmp_path / "katana450" / "events" / f"port-{server.port}"
        assert f"Event log: {folder}" in server.output
    assert records(folder)
