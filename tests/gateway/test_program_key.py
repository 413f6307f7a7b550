"""Test the key of a program that posts: it is secret, and others see only the name."""

from __future__ import annotations

import json
import secrets
import time
from typing import Any

from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.gateway.client import ask
from tests.gateway.lines import post
from tests.gateway.test_isolation import FAR


def test_program_key_is_secret_and_required() -> None:
    with AppServer(ATTENTIVE_APP) as server:
        key = secrets.token_hex(16)

        def do(**request: Any) -> tuple[int, Any]:
            status, _, body = ask(
                f"{server.url}/api/v1/do",
                data=json.dumps(request).encode(),
                X_Program=key,
                X_Name="Sorter",
            )
            return status, json.loads(body)

        assert do(do="acquire")[0] == 200
        pages = [json.loads(ask(f"{server.url}/api/v1/{at}")[2]) for at in ("state", "event_log")]
        assert pages[0]["holder"] == "Sorter"
        assert key not in json.dumps(pages)
        # The name of a program does not serve as its key.
        assert post(server, "Sorter", do="home")[0] == 422
        assert post(server, secrets.token_hex(16), do="home")[0] == 409
        assert key not in server.output
        # Reads of other clients, under any name, do not count as its heartbeats.
        assert do(do="joints", q=FAR.tolist())[0] == 200
        end = time.monotonic() + 10.0
        while (state := json.loads(ask(f"{server.url}/api/v1/state")[2]))["stopped"] is None:
            ask(f"{server.url}/api/v1/state", X_Program="Sorter", X_Name="Sorter")
            ask(f"{server.url}/api/v1/state", X_Program=secrets.token_hex(16))
            assert time.monotonic() < end
        # A starved machine says so in the sentence.
        assert "Sorter" in state["stopped"]
        assert "while the arm moved." in state["stopped"]
        assert state["q"][0] < FAR[0] - 0.2
        # Reads open no windows: only the two programs that posted have one.
        assert state["participants"] == 2
