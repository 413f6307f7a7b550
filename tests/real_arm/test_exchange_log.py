"""The log of the exchanges with an arm has a bounded size and never ends a motion."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from unittest.mock import Mock

import pytest

from katana450.errors import ConfigurationError
from katana450.extensions.real_arm.link import RECEIVED, SENT, ExchangeLog


def test_log_is_continued_and_begins_another_file_when_it_is_long(tmp_path: Path) -> None:
    path = tmp_path / "exchanges.log"
    with closing(ExchangeLog(path)) as log:
        log.note(SENT, b"\x01\x18")
    with closing(ExchangeLog(path)) as log:
        log.note(RECEIVED)
        first, second = path.read_text("ascii").splitlines()
        log.maxBytes = 100
        log.note(SENT, bytes(30))
    assert first.endswith(" > 01 18")
    assert second.endswith(" <")
    assert float(second.split()[0]) >= float(first.split()[0])
    assert (tmp_path / "exchanges.log.1").read_text("ascii").splitlines() == [first, second]
    assert path.read_text("ascii").count("\n") == 1


def test_full_disk_ends_neither_log_nor_caller(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "exchanges.log"
    with closing(ExchangeLog(path)) as log:
        with monkeypatch.context() as full:
            full.setattr(log, "format", Mock(side_effect=OSError("No space left on device")))
            log.note(SENT)
        assert capsys.readouterr().err == ""
        log.note(RECEIVED)
    assert path.read_text("ascii").endswith("<\n")
    with pytest.raises(ConfigurationError, match="cannot be written"):
        ExchangeLog(tmp_path / "none" / "exchanges.log")
