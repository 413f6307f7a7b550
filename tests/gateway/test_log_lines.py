"""Test that no text from outside starts or colours a line of the log."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import time

import pytest

from katana450.assembly.log_lines import LineFormatter, RepetitionFilter, printable
from katana450.client import connect
from katana450.server.api import requests
from tests.browser.server import APP, AppServer
from tests.gateway.client import ask, websocket
from tests.gateway.lines import Lines

FORGED = "2026-01-01 00:00:00,000 WARNING Stopped: Eve pressed STOP."

BREAKS = ["\n", "\r", "\r\n", "\v", "\f", "\x1b[2K\x1b[31m", "\x85", "\u2028", "\u2029", "\u202e"]
"""Characters that end a line or control a terminal."""

ENTRY = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} [A-Z]+ ")


@pytest.mark.parametrize("each", BREAKS)
def test_message_stays_on_its_line(each: str) -> None:
    record = logging.LogRecord(
        "katana450", logging.INFO, "", 0, "%s asks.", (f"Eve{each}{FORGED}",), None
    )
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


def test_printable_text_is_left_as_it_is() -> None:
    for text in ("", "Anna's arm: 5° ✓", "Ænna\u00a0".strip()):
        assert printable(text) == text


def test_log_names_the_person_who_stopped_the_arm() -> None:
    with AppServer() as server, connect(server.url, "Anna") as arm:
        arm.ask(requests.Stop())
        end = time.monotonic() + 10.0
        while " INFO Anna (websocket, anybody may stop the arm), Stop: " not in server.output:
            assert time.monotonic() < end, server.output
            time.sleep(0.02)


def test_requests_cannot_forge_a_line_of_the_log() -> None:
    """Send fields, values, names, headers and paths through every channel."""
    with AppServer((*APP, "--lines", "0")) as server:
        for each in BREAKS:
            evil = f"x{each}{FORGED}"
            asked = [{"do": evil}, {"do": "stop", evil: 1}, {"do": "tool", "name": evil}]
            asyncio.run(_say(server, [json.dumps(request) for request in asked]))
            lines = Lines(server)
            with lines.socket, lines.reader:
                lines.say(do="hello", name=f"x{each}y")
                lines.hear()
                lines.say(**{"do": "stop", evil: 1})
                assert lines.hear()["is"] == "refused"
        ask(f"{server.url}/api/v1/do", data=json.dumps({"do": FORGED}).encode(), X_Program="k" * 16)
        ask(f"{server.url}/enter", data=f"\n{FORGED}".encode(), Origin=server.url)
        time.sleep(0.3)
        output = server.output
    assert "Invalid request from" in output
    for line in output.splitlines():
        if FORGED in line:
            assert ENTRY.match(line), line
            assert not line.startswith(FORGED), line


async def _say(server: AppServer, texts: list[str]) -> None:
    async with websocket(server.url, "/api/v1/socket?name=Eve") as socket:
        await socket.recv()
        for text in texts:
            await socket.send(text)
            await socket.recv()
