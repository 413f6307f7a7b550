"""Test that the log continues over files, starts and kills, and the command that shows it."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

import pytest

from katana450.assembly.event_log.disk_log import DiskLog
from katana450.assembly.event_log.log_files import PRESENT, log_files
from katana450.assembly.event_log.records import MAX_LINE_BYTES, record
from katana450.cli.main import main
from tests.event_log.logs import newest, numbered, records, write

BREAKS = ["\n", "\r", "\v", "\f", "\x00", "\x1b[2K\x1b[31m", "\x85", "\u2028", "\u2029", "\u202e"]
"""Characters that end a line or control a terminal."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a log of 12 records in one file."""
    write(tmp_path / "log", numbered(10))
    return tmp_path / "log"


def lines(folder: Path) -> list[bytes]:
    return newest(folder).read_bytes().splitlines(keepends=True)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has other permissions")
def test_only_the_owner_can_read_the_log(folder: Path) -> None:
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o600}


def test_log_continues_over_files_and_starts(tmp_path: Path) -> None:
    for _ in range(3):
        write(tmp_path, numbered(10), max_file_bytes=1500, max_files=100)
    files = log_files(tmp_path)
    assert len(files) >= 3
    assert files[-1].name == PRESENT
    assert max(path.stat().st_size for path in files) <= 1500
    values = [entry["what"]["value"] for entry in records(tmp_path) if entry["kind"] == "command"]
    assert values == 3 * list(range(10))


def test_size_of_the_log_is_limited(tmp_path: Path) -> None:
    write(tmp_path, numbered(100), max_file_bytes=1500, max_files=3)
    files = log_files(tmp_path)
    assert len(files) == 3
    assert sum(path.stat().st_size for path in files) <= 3 * 1500
    assert records(tmp_path)[-1]["kind"] == "end"


def test_line_that_a_kill_has_torn_stays_alone(folder: Path) -> None:
    with newest(folder).open("ab") as file:
        file.write(b'{"kind":"st')
    write(folder, [])
    assert lines(folder)[12] == b'{"kind":"st\n'
    assert [entry["kind"] for entry in records(folder)[-3:]] == ["end", "start", "end"]


def test_numbered_files_of_an_earlier_version_are_shown_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = b'{"seq":7,"time":"2026-01-31T12:00:00.000Z","t":1.0,"kind":"start"}\n'
    (tmp_path / "events-000000000007.jsonl").write_bytes(old)
    write(tmp_path, numbered(10), max_file_bytes=600)
    assert main(["log", "show", str(tmp_path)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) == 13
    assert shown[0].startswith("2026-01-31T12:00:00.000Z")


@pytest.mark.parametrize("text", [*BREAKS, "\ud800", "\udfff\ud800", "😀"])
def test_hostile_text_stays_in_its_line(
    tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    forged = f'x{text}{{"seq":1}}'
    write(tmp_path, [record("refusal", {forged: forged}, who={"name": forged}, why=forged)])
    content = newest(tmp_path).read_bytes()
    assert content.count(b"\n") == 3
    assert all(32 <= byte < 127 for byte in content.replace(b"\n", b""))
    assert records(tmp_path)[1]["why"] == forged
    assert main(["log", "show", str(tmp_path)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) == 3
    assert all(line.isprintable() for line in shown)


def test_record_of_a_megabyte_is_replaced_by_its_length(tmp_path: Path) -> None:
    write(tmp_path, [record("refusal", {"request": "x" * 1_000_000})])
    _, entry, _ = records(tmp_path)
    assert entry["what"]["omitted_bytes"] > 1_000_000
    assert max(map(len, lines(tmp_path))) <= MAX_LINE_BYTES


def test_end_that_nobody_requested_is_recorded_as_a_failure(tmp_path: Path) -> None:
    for requested in (True, False):
        DiskLog(tmp_path, 8080).close(requested=requested)
    causes = [entry["what"]["cause"] for entry in records(tmp_path) if entry["kind"] == "end"]
    assert causes == ["requested", "the server could not start, or failed"]


def test_show_names_broken_lines(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = lines(folder)
    newest(folder).write_bytes(b"".join([*content[:6], b"\xff\x1b[31m\n", *content[6:]]))
    assert main(["log", "show", str(folder)]) == 1
    captured = capsys.readouterr()
    assert captured.err == f"{newest(folder).name}, line 7: this is not a record.\n"
    assert len(captured.out.splitlines()) == 12


def test_missing_log_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder in (tmp_path, tmp_path / "none"):
        assert main(["log", "show", str(folder)]) == 1
        assert f"There is no event log in {folder}" in capsys.readouterr().err
