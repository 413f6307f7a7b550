"""Test the key of a program that posts: it is secret, and others see only the name."""

from __future__ import annotations

import json
import secrets
from typing import Any

import pytest

from tests.gateway.postures import FAR
from tests.gateway.virtual import VirtualServer


def test_program_key_is_secret_and_required(
    local: VirtualServer, caplog: pytest.LogCaptureFixture
) -> None:
    key = secrets.token_hex(16)

    def do(**request: Any) -> tuple[int, Any]:
        names = {"X_Program": key, "X_Name": "Sorter"}
        status, _, body = local.ask("/api/v1/do", data=json.dumps(request).encode(), **names)
        return status, json.loads(body)

    assert do(do="acquire")[0] == 200
    pages = [json.loads(local.ask(f"/api/v1/{at}")[2]) for at in ("state", "event_log")]
    assert pages[0]["holder"] == "Sorter"
    assert key not in json.dumps(pages)
    # The name of a program does not serve as its key.
    assert local.post("Sorter", do="home")[0] == 422
    assert local.post(secrets.token_hex(16), do="home")[0] == 409
    assert key not in caplog.text
    # Reads of other clients, under any name, do not count as its heartbeats.
    assert do(do="joints", q=FAR.tolist())[0] == 200
    while (state := local.state()).stopped is None:
        local.ask("/api/v1/state", X_Program="Sorter", X_Name="Sorter")
        local.ask("/api/v1/state", X_Program=secrets.token_hex(16))
    assert state.stopped == "Sorter fell silent while the arm moved."
    assert state.q[0] < FAR[0] - 0.2
    # Reads open no windows: only the two programs that posted have one.
    assert state.participants == 2
