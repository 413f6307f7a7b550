"""Test programs: over a websocket, over HTTP, over a TCP port of a real server."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.lease import Role
from katana450.client import Client, RefusedError, connect
from katana450.server.api import answers, requests
from katana450.server.web.access_links import AccessFile
from tests.browser.server import AppServer
from tests.gateway.client import HOUR
from tests.gateway.lines import Lines, speaking
from tests.gateway.postures import THERE
from tests.gateway.virtual import VirtualServer


def test_refusals_have_one_form(local: VirtualServer) -> None:
    cases: list[tuple[str, dict[str, Any], int, str]] = [
        ("nowhere", {}, 404, "not_found"),
        ("stop", {}, 405, "method_not_allowed"),
        ("state", {"Origin": "http://evil.test"}, 403, "forbidden"),
        ("scripts/nowhere.yaml", {}, 404, "not_found"),
    ]
    for path, headers, status, code in cases:
        answered, _, body = local.ask(f"/api/v1/{path}", **headers)
        refused = json.loads(body)
        assert (answered, refused["is"], refused["code"]) == (status, "refused", code)
        assert refused["why"]


def test_every_query_is_answered(program: Client) -> None:
    for question in (requests.Heartbeat(n=3), requests.Query(at="loop"), requests.Watch(hz=0.0)):
        program.ask(question)
    for kind in (answers.State, answers.Arm, answers.Branches, answers.Loop):
        assert isinstance(program.query(kind), kind)
    refusals = (requests.Acquire(), requests.Take(), requests.Ask(), requests.Withdraw())
    for request in refusals:
        with pytest.raises(RefusedError):
            program.ask(request)


def test_json_lines_on_tcp_do_the_same(server: AppServer) -> None:
    with speaking(server, "Octave") as lines:
        lines.answer(do="clear_stop")
        done = lines.answer(do="joints", q=THERE.tolist())
        assert done["is"] == "done"
        lines.say(do="watch", hz=20)
        state: dict[str, Any] = {"ticket": -1}
        while state["ticket"] < done["ticket"] or state["moving"]:
            # Every request is a heartbeat.
            lines.say(do="heartbeat")
            while (state := lines.hear())["is"] != "state":
                pass
        np.testing.assert_allclose(state["q"], THERE, rtol=0, atol=1e-12)
        assert state["holder"] == "Octave"
        lines.say(do="watch", hz=0)
        assert "5 joints" in lines.answer(do="joints", q=[0])["why"]
        assert lines.answer(do="release_lease")["is"] == "done"


def test_tcp_connection_without_hello_is_closed(server: AppServer) -> None:
    for first in (
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b'POST / HTTP/1.1\r\n\r\n{"do":"stop"}\n',
        b'{"do": "stop"}\n',
        b'{"do": "hello"}\n',
        b"\xff\xfe\n",
        b"\n",
        b"x" * 100_000,
    ):
        lines = Lines(server)
        with lines.socket, lines.reader:
            with suppress(ConnectionError):
                lines.raw(first)
            assert lines.ends()
    with connect(server.url) as program:
        assert program.query(answers.State).stopped is None


def test_repeated_invalid_requests_close_the_connection(local: VirtualServer) -> None:
    before = local.state()
    with local.speaking() as rows:
        for text in ("{", "[]", '{"do":"fly"}', '{"do":"joints","q":[NaN,0,0,0,0]}',
                     '{"do":"joints","q":[1e999,0,0,0,0],"id":4}', '{"do":"watch","hz":-1}',
                     '{"do":"joints"}', '{"do":"stop","now":true}'):  # fmt: skip
            rows.raw(text.encode())
            assert rows.hear()["is"] == "refused"
        for _ in range(60):
            rows.raw(b"{")
        assert rows.ends() == 1008
    after = local.state()
    assert (after.q, after.holder, after.stopped) == (before.q, before.holder, before.stopped)


def test_single_requests_can_be_posted(local: VirtualServer) -> None:
    status, done = local.post(do="clear_stop", id=1)
    assert (status, done["is"], done["id"], done["outcome"]) == (200, "done", 1, "accepted")
    status, done = local.post(do="joint", axis=5, value=0.3)
    assert status == 200
    state: dict[str, Any] = {"ticket": 0}
    while state["ticket"] < done["ticket"] or state["moving"]:
        status, _, body = local.ask("/api/v1/state", X_Program="a-test-that-posts")
        assert status == 200
        state = json.loads(body)
        assert state["stopped"] is None
        time.sleep(0.05)
    assert state["q"][4] == pytest.approx(0.3, abs=1e-12)
    status, answer = local.post("another-program-there", do="home", id="h")
    assert (status, answer["is"], answer["id"]) == (409, "refused", "h")
    assert "holds the arm" in answer["why"]
    assert local.post(do="fly")[0] == 422
    assert local.post(do="watch", hz=3)[0] == 422
    assert local.post("short", do="home")[0] == 422
    assert local.ask("/api/v1/do", data=b"x" * 5000, X_Program="a-test-that-posts")[0] == 413
    assert local.post(do="release_lease")[0] == 200


def test_program_needs_a_token_if_the_server_requires_links(
    guarded: VirtualServer, file: AccessFile
) -> None:
    viewer, operator = (
        file.give(role.value, role, time.time() + HOUR) for role in (Role.VIEWER, Role.OPERATOR)
    )
    for token in ("", "guess"):
        with pytest.raises(RefusedError), guarded.connect(token=token):
            pass
    assert guarded.ask("/api/v1/state")[0] == 401
    assert guarded.ask("/api/v1/stop", data=b"", Authorization="Bearer x")[0] == 401
    with guarded.connect("script", viewer) as watcher:
        assert (watcher.welcome.name, watcher.welcome.role) == ("viewer, script", "viewer")
        with pytest.raises(RefusedError, match="may only watch"):
            watcher.ask(requests.Home())
        with guarded.connect("script", operator) as driver:
            assert driver.joints(THERE).status == "ok"
            with pytest.raises(RefusedError):
                driver.ask(requests.Take())
