"""Tests of atomic files: written completely or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import pytest

from katana450.atomic import check_writable, write_files
from katana450.errors import InputError


def good(file: BinaryIO) -> None:
    file.write(b"new")


def interrupted(file: BinaryIO) -> None:
    file.write(b"half")
    raise KeyboardInterrupt


def test_files_are_written_over_old_ones(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_bytes(b"old")
    write_files({one: good, two: good})
    assert one.read_bytes() == two.read_bytes() == b"new"
    assert sorted(tmp_path.iterdir()) == [one, two]


def test_an_interrupt_changes_no_file(tmp_path: Path) -> None:
    """The first file is complete; without the second it is not put in place either."""
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt):
        write_files({one: good, two: interrupted})
    assert one.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [one]


def test_a_new_file_has_the_usual_permissions(tmp_path: Path) -> None:
    plain, ours = tmp_path / "plain", tmp_path / "ours"
    plain.write_bytes(b"")
    write_files({ours: good})
    assert ours.stat().st_mode == plain.stat().st_mode


def test_an_unwritable_file_is_an_error(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere" / "file", tmp_path):
        with pytest.raises(InputError, match=path.name):
            check_writable(path)
        with pytest.raises(InputError, match="cannot be written"):
            write_files({path: good})
    assert list(tmp_path.iterdir()) == []
    check_writable(tmp_path / "file")
