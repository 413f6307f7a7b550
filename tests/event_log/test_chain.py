"""Test that the log continues over files, starts and kills, and that no change goes unnoticed."""

from __future__ import annotations

import random
import shutil
import stat
import sys
from pathlib import Path

import pytest

from katana450.cli.main import main
from katana450.extensions.event_log.disk_log import DiskLog
from katana450.extensions.event_log.folder import log_files
from katana450.extensions.event_log.records import FIRST_HASH, MAX_LINE_BYTES, hash_of, record
from katana450.extensions.event_log.verification import verified
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


def verify(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Return the exit status of the command and what it printed."""
    status = main(["log", "verify", str(folder)])
    return status, capsys.readouterr().out


def test_each_record_holds_the_hash_of_the_line_before(folder: Path) -> None:
    content = newest(folder).read_bytes().splitlines()
    found = records(folder)
    assert [each["seq"] for each in found] == list(range(1, 13))
    assert [each["prev"] for each in found] == [FIRST_HASH, *map(hash_of, content[:-1])]
    assert found[0]["kind"] == "start"
    assert found[0]["what"]["after"]["continues"] == {"seq": 0, "sha256": FIRST_HASH}
    assert found[0]["time"].endswith("Z")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has other permissions")
def test_only_the_owner_can_read_the_log(folder: Path) -> None:
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o600}


def test_intact_log_is_confirmed_with_its_last_hash(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, text = verify(folder, capsys)
    assert status == 0
    assert "The chain is intact." in text
    assert hash_of(lines(folder)[-1][:-1]) in text


def test_chain_continues_over_files_and_starts(tmp_path: Path) -> None:
    for _ in range(3):
        write(tmp_path, numbered(10), max_file_bytes=1500, max_files=100)
    assert len(log_files(tmp_path)) >= 5
    report = verified(tmp_path)
    assert (report.records, report.faults, report.notes) == (36, [], [])
    starts = [each for each in records(tmp_path) if each["kind"] == "start"]
    assert [each["what"]["after"]["continues"]["seq"] for each in starts] == [0, 12, 24]


def test_size_of_the_log_is_limited(tmp_path: Path) -> None:
    write(tmp_path, numbered(100), max_file_bytes=1500, max_files=3)
    files = log_files(tmp_path)
    assert len(files) == 3
    assert sum(path.stat().st_size for path in files) <= 3 * 1500
    report = verified(tmp_path)
    assert report.faults == []
    assert report.head.seq == 102
    # Rotation deletes the oldest file; the head shows that nobody else has.
    files[0].unlink()
    assert "missing before it" in verified(tmp_path).faults[0]


def test_kill_at_the_deletion_of_the_oldest_file_is_no_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unlink, copies = Path.unlink, list[Path]()
    write(tmp_path / "log", [])

    def copying(path: Path, missing_ok: bool = False) -> None:
        for deletes in (False, True):
            if deletes:
                unlink(path, missing_ok)
            copies.append(tmp_path / f"copy{len(copies)}")
            shutil.copytree(path.parent, copies[-1])

    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", copying)
        write(tmp_path / "log", numbered(40), max_file_bytes=1500, max_files=3)
    assert len(copies) >= 4
    for folder in copies:
        assert verified(folder).faults == []
        # The next start takes the oldest record from the head.
        write(folder, numbered(2), max_files=3)
        assert verified(folder).faults == []


def test_flipped_byte_is_found_with_its_line(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = bytearray(newest(folder).read_bytes())
    at = content.index(b'"value":4') + len(b'"value":')
    content[at] ^= 1
    newest(folder).write_bytes(content)
    status, text = verify(folder, capsys)
    assert status == 1
    assert f"{newest(folder).name}, line 6: the content does not match the hash in" in text
    assert "The log was changed or cut: 1 faults." in text


def test_every_flipped_byte_is_found(folder: Path) -> None:
    whole = newest(folder).read_bytes()
    chance = random.Random(1)
    for at in chance.sample(range(len(whole)), 300):
        content = bytearray(whole)
        content[at] ^= 1 << chance.randrange(8)
        newest(folder).write_bytes(content)
        assert verified(folder).faults, (at, content[at - 20 : at + 20])


def test_deleted_line_is_found_with_its_place(folder: Path) -> None:
    content = lines(folder)
    newest(folder).write_bytes(b"".join(content[:5] + content[6:]))
    (fault,) = verified(folder).faults
    assert fault == f"{newest(folder).name}, line 6: record 6 is missing before it."


def test_swapped_lines_are_found_with_their_places(folder: Path) -> None:
    content = lines(folder)
    content[4], content[5] = content[5], content[4]
    newest(folder).write_bytes(b"".join(content))
    first, second = verified(folder).faults
    assert first == f"{newest(folder).name}, line 5: record 5 is missing before it."
    assert second == f"{newest(folder).name}, line 6: record 5 is out of order, after record 6."


@pytest.mark.parametrize("cut", [1, 3])
def test_cut_end_is_found_by_the_head(folder: Path, cut: int) -> None:
    newest(folder).write_bytes(b"".join(lines(folder)[:-cut]))
    (fault,) = verified(folder).faults
    assert fault.startswith(f"{newest(folder).name}, line {12 - cut}: record")
    assert fault.endswith("missing after it.")


def test_end_cut_within_a_line_is_found_by_the_head(folder: Path) -> None:
    newest(folder).write_bytes(newest(folder).read_bytes()[:-20])
    (fault,) = verified(folder).faults
    assert fault.endswith("line 11: record 12 is missing after it.")


def test_cut_end_stays_visible_after_the_next_start(folder: Path) -> None:
    newest(folder).write_bytes(b"".join(lines(folder)[:-3]))
    write(folder, numbered(2))
    report = verified(folder)
    assert "line 10: records 10 to 12 are missing before it." in report.faults[0]
    assert "record 12 was the last one, and was gone" in report.faults[1]
    assert len(report.faults) == 2
    assert report.head.seq == 16


def test_added_line_is_found(folder: Path) -> None:
    content = lines(folder)
    newest(folder).write_bytes(b"".join([*content[:6], b'{"forged": true}\n', *content[6:]]))
    (fault,) = verified(folder).faults
    assert "line 7: this is not a record" in fault


def test_missing_file_is_found(tmp_path: Path) -> None:
    write(tmp_path, numbered(30), max_file_bytes=1500, max_files=100)
    files = log_files(tmp_path)
    files[2].unlink()
    (fault,) = verified(tmp_path).faults
    assert fault.startswith(f"{files[3].name}, line 1: records")


def test_missing_head_is_found_now_and_after_the_next_start(folder: Path) -> None:
    (folder / "head").unlink()
    assert "The file head is missing" in verified(folder).faults[0]
    write(folder, [])
    (fault,) = verified(folder).faults
    assert "the file head was gone when the server opened the log" in fault


def test_line_that_a_kill_has_torn_is_explained_by_the_next_start(folder: Path) -> None:
    with newest(folder).open("ab") as file:
        file.write(b'{"seq":13,"ti')
    report = verified(folder)
    assert report.faults == []
    assert "line 13: the last line is incomplete" in report.notes[0]
    write(folder, numbered(2))
    report = verified(folder)
    assert report.faults == []
    assert "line 13: an incomplete record of 13 bytes" in report.notes[0]
    # The explanation is for these bytes alone.
    newest(folder).write_bytes(newest(folder).read_bytes().replace(b'13,"ti\n', b'14,"ti\n'))
    assert "line 13: this is not a record" in verified(folder).faults[0]


@pytest.mark.parametrize("each", [*BREAKS, "\ud800", "\udfff\ud800", "😀"])
def test_hostile_text_stays_in_its_line(
    tmp_path: Path, each: str, capsys: pytest.CaptureFixture[str]
) -> None:
    forged = f'x{each}{{"seq":1}}'
    write(tmp_path, [record("refusal", {forged: forged}, who={"name": forged}, why=forged)])
    content = newest(tmp_path).read_bytes()
    assert content.count(b"\n") == 3
    assert all(32 <= byte < 127 for byte in content.replace(b"\n", b""))
    assert records(tmp_path)[1]["why"] == forged
    assert main(["log", "show", str(tmp_path)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) == 3
    assert all(line.isprintable() for line in shown)
    assert verified(tmp_path).faults == []


def test_record_of_a_megabyte_is_replaced_by_its_length(tmp_path: Path) -> None:
    write(tmp_path, [record("refusal", {"request": "x" * 1_000_000})])
    _, found, _ = records(tmp_path)
    assert found["what"]["omitted_bytes"] > 1_000_000
    assert max(map(len, lines(tmp_path))) <= MAX_LINE_BYTES
    assert verified(tmp_path).faults == []


def test_show_filters_by_time_participant_and_kind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    anna = {"name": "Anna", "role": "operator", "address": "10.0.0.7"}
    old = {"time": "2026-01-01T00:00:00.000Z", "kind": "stop", "who": anna}
    write(tmp_path, [old, record("stop", who=anna), record("lease", who={"name": "Bert"})])

    def shown(*options: str) -> list[str]:
        assert main(["log", "show", str(tmp_path), *options]) == 0
        return [line.split()[0] for line in capsys.readouterr().out.splitlines()]

    assert shown() == ["1", "2", "3", "4", "5"]
    assert shown("--kind", "stop") == ["2", "3"]
    assert shown("--kind", "stop", "--kind", "lease") == ["2", "3", "4"]
    assert shown("--who", "anna", "--since", "10m") == ["3"]
    assert shown("--who", "10.0.0.7", "--since", "2025-12-31") == ["2", "3"]


@pytest.mark.parametrize(
    ("since", "shown"),
    [
        ("2026-01-31T11:59:59", True),
        ("2026-01-31 12:00:01", False),
        ("2026-01-31T13:59:59+02:00", True),
        ("2026-01-31T14:00:01+02:00", False),
        ("2026-01-31T09:00:01-03:00", False),
        ("2026-01-31T12:00:00Z", True),
        ("2026-01-31", True),
    ],
)
def test_show_takes_a_time_of_any_zone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], since: str, shown: bool
) -> None:
    write(tmp_path, [{"time": "2026-01-31T12:00:00.000Z", "kind": "stop"}])
    assert main(["log", "show", str(tmp_path), "--since", since, "--kind", "stop"]) == 0
    assert bool(capsys.readouterr().out) == shown


def test_show_refuses_a_time_that_is_none(capsys: pytest.CaptureFixture[str]) -> None:
    for since in ("noon", "0001-01-01T00:00+02:00"):
        with pytest.raises(SystemExit):
            main(["log", "show", "--since", since])
        assert "a time such as 30m, 12h, 7d" in capsys.readouterr().err


def test_end_that_nobody_requested_is_recorded_as_a_failure(tmp_path: Path) -> None:
    for requested in (True, False):
        DiskLog(tmp_path, 8080).close(requested=requested)
    causes = [each["what"]["cause"] for each in records(tmp_path) if each["kind"] == "end"]
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
        assert main(["log", "verify", str(folder)]) == 1
        assert f"There is no event log in {folder}" in capsys.readouterr().err
