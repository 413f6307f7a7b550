"""Test STOP on a port and in a process of its own, with real servers and real attacks."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from katana450.client import Client, connect
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer, ServerError
from tests.gateway.client import ask, controlling, enter, page_name, state_of
from tests.gateway.postures import THERE
from tests.gateway.test_watchdogs import under_way
from tests.waiting import until

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="finds the server's processes as Linux lists them"
)


@pytest.fixture
def program(server: AppServer) -> Iterator[Client]:
    with connect(server.url, "Driver") as program:
        program.clear_stop()
        program.go(requests.Home())
        yield program
        program.clear_stop()
        program.ask(requests.ReleaseLease())


def stop(url: str, *, path: str = "/api/v1/stop", **headers: str) -> tuple[int, dict[str, str]]:
    """Return status and answer of a STOP."""
    status, _, body = ask(f"{url}{path}", data=b"", **headers)
    return status, json.loads(body) if body.startswith(b"{") else {"words": body.decode()}


def stop_processes(server: AppServer) -> list[int]:
    with suppress(ServerError, OSError):
        return [server.stop_process]
    return []


async def test_stop_of_a_page_is_confirmed_and_named_like_on_the_main_port(
    server: AppServer,
) -> None:
    cookie, page = enter(server.url), page_name()
    async with controlling(server.url, cookie, page) as control:
        await control.wait(mood="ok")
        path = f"/stop?press=one&page={page}"
        status, headers, body = await asyncio.to_thread(
            ask, f"{server.stop_url}{path}", data=b"", Cookie=cookie, Origin=server.url
        )
        assert (status, json.loads(body)["stop"]) == (200, "confirmed")
        # The page may read the answer.
        assert headers["access-control-allow-origin"] == server.url
        assert headers["access-control-allow-credentials"] == "true"
        shown = await control.wait(stop="confirmed")
        assert shown["stopped"] == "You pressed STOP."
        assert abs(shown["stopped_at"] - time.time()) < 10.0
        await control.clear_stop()
        await control.say("release_lease")
        await control.wait(holder=None)


def test_page_learns_the_port_when_it_signs_in(server: AppServer) -> None:
    port = server.stop_url.rpartition(":")[2]
    _, headers, _ = ask(f"{server.url}/enter", data=b'{"token":""}', Origin=server.url)
    assert headers["x-stop-port"] == port
    _, headers, _ = ask(server.url)
    assert f"connect-src 'self' {server.stop_url};" in headers["content-security-policy"]
    # A page that came through a forwarded port cannot reach the other one.
    forwarded = {"Host": "localhost:9000", "Origin": "http://localhost:9000"}
    _, headers, _ = ask(f"{server.url}/enter", data=b'{"token":""}', **forwarded)
    assert "x-stop-port" not in headers
    _, headers, _ = ask(server.url, Host="localhost:9000")
    assert "connect-src 'self';" in headers["content-security-policy"]


def test_press_on_two_paths_counts_once_even_if_a_copy_is_late(
    server: AppServer, program: Client
) -> None:
    copies = (server.url, server.stop_url)
    for first, second in (copies, copies[::-1]):
        query = f"?press={page_name()}"
        before = program.query(answers.State).revocations
        assert ask(f"{first}/api/v1/stop{query}", data=b"", X_Name="Vera")[0] in (200, 204)
        until(lambda: program.query(answers.State).stop == "confirmed")
        assert ask(f"{second}/api/v1/stop{query}", data=b"", X_Name="Vera")[0] in (200, 204)
        state = program.query(answers.State)
        assert (state.stopped, state.revocations) == ("Vera pressed STOP.", before + 1)
        program.clear_stop()
        # A late copy neither stops the arm again nor takes the motion away.
        program.ask(requests.Speed(value=1.0))
        program.ask(requests.Joints(q=THERE))
        for url in copies:
            ask(f"{url}/api/v1/stop{query}", data=b"", X_Name="Vera")
        time.sleep(0.2)
        state = program.query(answers.State)
        assert (state.stopped, state.moving) == (None, True)
        program.go(requests.Home())


def test_unknown_senders_and_other_paths_are_refused(server: AppServer) -> None:
    cookie, url = enter(server.url), server.stop_url
    foreign = "http://127.0.0.1:1"
    assert stop(url, path="/stop", Origin=server.url)[0] == 401
    assert stop(url, path="/stop", Cookie=cookie)[0] == 403
    assert stop(url, path="/stop", Cookie=cookie, Origin=foreign)[0] == 403
    assert stop(url, Origin=foreign)[0] == 403
    assert stop(url, Host="evil.example")[0] == 403
    assert ask(f"{url}/api/v1/stop")[0] == 405
    assert ask(f"{url}/api/v1/state")[0] == 404
    assert ask(f"{url}/health")[::2] == (200, b"ok\n")
    with socket.create_connection(("127.0.0.1", int(url.rpartition(":")[2])), 5.0) as raw:
        raw.sendall(b"nonsense\r\n\r\n")
        assert raw.recv(100).startswith(b"HTTP/1.1 400 ")
    until(lambda: state_of(server)["stopped"] is None)


def test_stop_with_a_body_or_without_reading_the_answer_counts(
    server: AppServer, program: Client
) -> None:
    under_way(program)
    with socket.create_connection(("127.0.0.1", int(server.stop_url.rpartition(":")[2]))) as raw:
        # The sender is gone before the answer; its body never comes.
        raw.sendall(b"POST /api/v1/stop HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n")
    until(lambda: program.query(answers.State).stop == "confirmed")


def test_stop_is_confirmed_while_the_front_end_is_frozen(
    server: AppServer, program: Client
) -> None:
    # The timeout of the front end is long, so that only STOP can stop the arm.
    before = under_way(program)
    with server.frozen(server.front):
        assert stop(server.stop_url, X_Name="Vera")[0] == 200
    until(lambda: program.query(answers.State).stop == "confirmed")
    state = program.query(answers.State)
    # The reason is the press, not the silence, because the press came first.
    assert state.stopped == "Vera pressed STOP."
    assert state.q[0] - before.q[0] < 1.5


def test_ended_stop_process_is_reported_and_restarted_while_the_arm_moves() -> None:
    with AppServer(APP) as server, connect(server.url, "Driver") as program:
        program.ask(requests.Speed(value=0.1))
        program.ask(requests.Joints(q=THERE))
        killed = server.stop_process
        os.kill(killed, signal.SIGKILL)
        until(lambda: "is started again" in server.output)
        until(lambda: stop_processes(server) not in ([], [killed]))
        until(lambda: stop(server.stop_url, path="/health")[0] == 405)
        assert program.query(answers.State).stopped is None
        # A process that hangs is noticed, reported, ended and replaced.
        hung = server.stop_process
        os.kill(hung, signal.SIGSTOP)
        until(lambda: ask(f"{server.url}/health")[0] == 503)
        assert b"STOP is not served on port" in ask(f"{server.url}/health")[2]
        until(lambda: ask(f"{server.url}/health")[0] == 200)
        assert stop_processes(server) not in ([], [hung])
        assert program.query(answers.State).stopped is None
        assert stop(server.stop_url, X_Name="Vera")[0] == 200


class ProxiedServer(AppServer):
    """A server that prints the address of its proxy, at which nothing answers here."""

    def __init__(self, public: str) -> None:
        super().__init__((*APP, "--public-url", public))
        self.local, self.url = self.url, public


@pytest.mark.long
def test_page_behind_a_proxy_sends_stop_to_its_own_address() -> None:
    public = "https://arm.example.org"
    with ProxiedServer(public) as server:
        data, of_page = b'{"token":""}', {"Host": "arm.example.org", "Origin": public}
        status, headers, _ = ask(f"{server.local}/enter", data=data, **of_page)
        assert status == 204
        assert "x-stop-port" not in headers
        cookie = headers["set-cookie"].partition(";")[0]
        # The proxy passes the path on to the port of STOP.
        stop_url = f"http://127.0.0.1:{server.stop_url.rpartition(':')[2]}"
        status, answer = stop(stop_url, path="/stop", Cookie=cookie, **of_page)
        assert (status, answer["stop"]) == (200, "confirmed")


def test_client_stops_on_all_paths_and_clears_when_possible(
    server: AppServer, program: Client
) -> None:
    under_way(program)
    assert program.welcome.stop_port == int(server.stop_url.rpartition(":")[2])
    assert program.stop() == "confirmed"
    state = program.query(answers.State)
    assert state.stopped == f"{program.welcome.name} pressed STOP."
    # As the option of the server demands of a simulated arm.
    assert state.silence_profile == "real arm"
    program.clear_stop()
    assert program.query(answers.State).stopped is None
