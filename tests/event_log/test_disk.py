"""Test that a full, missing or stuck disk neither delays nor ends the server."""

from __future__ import annotations

import logging
import os
import sys
import time
from pathlib import Path

import pytest

from katana450.assembly.event_log.disk_log import PRESENT, LogFiles
from katana450.assembly.event_log.record_maker import Record
from katana450.client import connect
from katana450.server.api import requests
from tests.browser.server import APP, AppServer
from tests.event_log.logs import Writer, numbered, records
from tests.waiting import until

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such devices")


def full(folder: Path) -> Path:
    """Return the first file of a log in ``folder``, on a device that is always full."""
    folder.mkdir()
    (folder / PRESENT).symlink_to("/dev/full")
    return folder / PRESENT


def test_writer_continues_when_a_full_disk_has_room_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "log"
    device = full(folder)
    with caplog.at_level(logging.WARNING, "katana450"):
        writer = Writer(folder)
        writer.note(*numbered(50))
        until(lambda: caplog.records)
        (entry,) = caplog.records
        assert "cannot be written: No space left on device" in entry.getMessage()
        assert "No space left" in writer.recorder.problem
        device.unlink()
        until(lambda: "is written again" in caplog.text)
        assert writer.recorder.problem == ""
    writer.close()
    lost, end = records(folder)
    assert (lost["kind"], lost["what"]["count"], end["kind"]) == ("lost", 51, "end")
    assert "No space left" in lost["why"]


def test_lost_records_stand_between_those_before_and_after_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written, room = LogFiles.append, [3]

    def append(file: LogFiles, content: Record) -> None:
        if not room[0]:
            raise OSError(28, "No space left on device")
        room[0] -= 1
        written(file, content)

    monkeypatch.setattr(LogFiles, "append", append)
    writer = Writer(tmp_path)
    writer.note(*numbered(6))
    until(lambda: not room[0])
    until(lambda: writer.recorder.problem)
    room[0] = 100
    writer.close()
    start, *early, lost, end = records(tmp_path)
    assert [entry["what"]["value"] for entry in early] == [0, 1]
    assert (start["kind"], lost["what"]["count"], end["kind"]) == ("start", 4, "end")


def test_second_writer_of_a_folder_waits_for_the_first(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = Writer(tmp_path)
    until(lambda: (tmp_path / PRESENT).exists() and records(tmp_path))
    second = Writer(tmp_path)
    until(lambda: "another server writes there" in caplog.text)
    first.close()
    # The place is free now.
    second.close()
    assert [entry["kind"] for entry in records(tmp_path)] == ["start", "end", "lost", "end"]


def test_server_drives_and_stops_while_the_disk_is_full(tmp_path: Path) -> None:
    folder = tmp_path / "log"
    device = full(folder)
    with AppServer((*APP, "--log", str(folder))) as server, connect(server.url, "Anna") as arm:
        arm.go(requests.Joint(axis=1, value=0.1))
        arm.ask(requests.Stop())
        assert server.output.count("cannot be written") == 1
        device.unlink()
        until(lambda: "is written again" in server.output)
        arm.clear_stop()
    assert {"lost", "clear", "end"} <= {entry["kind"] for entry in records(folder)}


@pytest.mark.long
def test_server_drives_stops_and_ends_while_the_disk_is_stuck(tmp_path: Path) -> None:
    """Give the log a pipe without a reader: opening it for writing never returns."""
    os.mkfifo(tmp_path / PRESENT)
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
def test_option_no_log_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with AppServer((*APP, "--no-log")) as server:
        assert "Event log" not in server.output
    assert list(tmp_path.iterdir()) == []
    with AppServer() as server:
        folder = tmp_path / "katana450" / "events" / f"port-{server.port}"
        assert f"Event log: {folder}" in server.output
    assert records(folder)
