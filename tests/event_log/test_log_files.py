"""Test that the log continues over files, starts and kills, and that its lines are bounded."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

from katana450.assembly.event_log.disk_log import PRESENT
from katana450.assembly.event_log.record_maker import MAX_TEXT
from tests.event_log.logs import lines, log_files, numbered, records, write

BREAKS = ["\n", "\r", "\v", "\f", "\x00", "\x1b[2K\x1b[31m", "\x85", "\u2028", "\u2029", "\u202e"]
"""Characters that end a line or control a terminal."""


def test_log_continues_over_files_starts_and_kills_and_only_its_owner_can_read_it(
    tmp_path: Path,
) -> None:
    for _ in range(3):
        write(tmp_path, *numbered(10), max_bytes=1500, files=100)
    files = log_files(tmp_path)
    assert len(files) >= 3
    assert files[-1].name == PRESENT
    assert max(path.stat().st_size for path in files) <= 1500
    values = [entry["what"]["value"] for entry in records(tmp_path) if entry["kind"] == "refusal"]
    assert values == 3 * list(range(10))
    if sys.platform != "win32":
        assert {stat.S_IMODE(path.stat().st_mode) for path in files} == {0o600}
    # A kill has torn a line, which stays alone.
    with files[-1].open("ab") as file:
        file.write(b'{"kind":"st')
    write(tmp_path)
    assert [b'"end"' in line for line in lines(tmp_path)[-4:]] == [True, False, False, True]


def test_size_of_the_log_is_limited(tmp_path: Path) -> None:
    write(tmp_path, *numbered(100), max_bytes=1500, files=3)
    files = log_files(tmp_path)
    assert len(files) == 3
    assert sum(path.stat().st_size for path in files) <= 3 * 1500
    assert records(tmp_path)[-1]["kind"] == "end"


def test_hostile_and_long_texts_stay_in_their_lines(tmp_path: Path) -> None:
    texts = [f'x{text}{{"seq":1}}' for text in (*BREAKS, "\ud800", "\udfff\ud800", "😀")]
    write(tmp_path, *({text: text} for text in texts), {"request": "x" * 1_000_000})
    assert all(32 <= byte < 127 for byte in b"".join(lines(tmp_path)))
    _, *hostile, long, _ = records(tmp_path)
    assert [entry["what"] for entry in hostile] == [{text: text} for text in texts]
    assert len(long["what"]["request"]) < MAX_TEXT + 30
