"""Test that no text from outside starts or colours a line of the log."""

from __future__ import annotations

import json
import logging
import re
import time
from typing import Any
from urllib.parse import quote

import pytest

from katana450.assembly.log_output import LineFormatter, RepetitionFilter
from katana450.client import connect
from katana450.server.api import requests
from tests.browser.server import AppServer
from tests.gateway.virtual import VirtualServer
from tests.waiting import until

FORGED = "2026-01-01 00:00:00,000 WARNING Stopped: Eve pressed STOP."

BREAKS = ["\n", "\r", "\r\n", "\v", "\f", "\x1b[2K\x1b[31m", "\x85", "\u2028", "\u2029", "\u202e"]
"""Characters that end a line or control a terminal."""

ENTRY = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} [A-Z]+ ")


def test_message_stays_on_its_line() -> None:
    for line_break in BREAKS:
        evil = (f"Eve{line_break}{FORGED}",)
        record = logging.LogRecord("katana450", logging.INFO, "", 0, "%s asks.", evil, None)
        line = LineFormatter().format(record)
        assert line.isprintable()
        assert len(line.splitlines()) == 1
        assert FORGED in line


def test_traceback_follows_on_marked_lines() -> None:
    try:
        raise ValueError(f"no\n{FORGED}")
    except ValueError as error:
        about = (ValueError, error, error.__traceback__)
    record = logging.LogRecord("katana450", logging.ERROR, "", 0, "A fault.", None, about)
    first, *rest = LineFormatter().format(record).splitlines()
    assert first.endswith("A fault.")
    assert len(rest) > 2
    assert all(line.startswith("    | ") for line in rest)


def test_flood_makes_few_lines_and_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    repetitions, formatter = RepetitionFilter(), LineFormatter()

    def printed(text: str, value: object) -> str | None:
        record = logging.LogRecord("katana450", logging.WARNING, "", 0, text, (value,), None)
        return formatter.format(record) if repetitions.filter(record) else None

    flood = [printed("Invalid request from %s.", n) for n in range(1000)]
    assert sum(line is not None for line in flood) == 20
    # Other entries are printed meanwhile.
    assert printed("Stopped: %s.", "Anna")
    clock[0] += 10.0
    line = printed("Invalid request from %s.", "Eve")
    assert line is not None
    assert line.endswith("Invalid request from Eve. (and 980 more such lines before)")
    assert "before" not in str(printed("Invalid request from %s.", "Eve"))


def test_log_names_the_person_who_stopped_the_arm(server: AppServer) -> None:
    with connect(server.url, "Anna") as arm:
        arm.ask(requests.Stop())
        until(lambda: " WARNING Stopped: Anna pressed STOP." in server.output)


def test_requests_cannot_forge_a_line_of_the_log(
    local: VirtualServer, caplog: pytest.LogCaptureFixture
) -> None:
    """Send fields, values, names, headers and paths through every channel."""
    for line_break in BREAKS:
        evil = f"x{line_break}{FORGED}"
        questions: list[dict[str, Any]] = [
            {"do": evil},
            {"do": "stop", evil: 1},
            {"do": "tool", "name": evil},
        ]
        with local.speaking(quote(f"x{line_break}y")) as rows:
            for request in questions:
                rows.say(**request)
                assert rows.hear()["is"] == "refused"
    forged = json.dumps({"do": FORGED}).encode()
    local.ask("/api/v1/do", data=forged, X_Program="k" * 16)
    local.ask("/enter", data=f"\n{FORGED}".encode(), Origin=local.url)
    lines = [LineFormatter().format(record) for record in caplog.records]
    assert any("Invalid request from" in line for line in lines)
    for line in lines:
        assert len(line.splitlines()) == 1
        assert ENTRY.match(line), line
        assert not line.startswith(FORGED), line
