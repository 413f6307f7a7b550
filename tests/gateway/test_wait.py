"""Test requests with `wait`: one request makes one whole motion and is answered at its end."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from katana450.client import Client, RefusedError, connect
from katana450.server.api import answers, requests
from tests.browser.server import ATTENTIVE_APP, SIMULATION_APP, AppServer
from tests.gateway.client import ask
from tests.gateway.lines import post, speaking
from tests.gateway.postures import READY, THERE
from tests.gateway.waiting import (
    check_nothing_moves_later,
    moving,
    slow,
    under_way,
    wait_for,
    wall,
)


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    """Start a server that stops the arm after 0.25 s without a heartbeat, as a real arm."""
    with AppServer((*ATTENTIVE_APP, "--lines", "0")) as server:
        yield server


@pytest.fixture
def watcher(server: AppServer) -> Iterator[Client]:
    """Connect a program that does not drive, after it has made the arm ready."""
    with connect(server.url, "Watcher") as watcher:
        watcher.clear_stop()
        watcher.ask(requests.Speed(value=1.0))
        watcher.go(requests.Home())
        watcher.ask(requests.ReleaseLease())
        yield watcher


@pytest.mark.parametrize(
    "request_",
    [
        {"do": "joints", "q": THERE.tolist()},
        pytest.param({"do": "joint", "axis": 1, "value": 0.5}, marks=pytest.mark.long),
        {"do": "nudge", "axis": 1, "by": -0.4},
        pytest.param({"do": "position", "p": [0.4, 0.1, 0.05]}, marks=pytest.mark.long),
        pytest.param({"do": "turn", "pitch": 0.3, "roll": 0.2}, marks=pytest.mark.long),
        pytest.param({"do": "step_tool", "by": [0.0, 0.0, 0.05, 0.0, 0.0]}, marks=pytest.mark.long),
        {"do": "gripper", "angle": 0.2},
        pytest.param({"do": "go_to_zero"}, marks=pytest.mark.long),
        pytest.param(
            {"do": "set", "node": "axis_1", "field": "rotation", "value": [0, 0, 1, 0.6]},
            marks=pytest.mark.long,
        ),
    ],
    ids=lambda request: str(request["do"]),
)
def test_one_request_over_http_makes_one_whole_motion(
    server: AppServer, watcher: Client, request_: dict[str, Any]
) -> None:
    began = watcher.query(answers.State)
    slow(watcher)
    status, done = post(server, **request_, wait=60)
    assert (status, done["is"], done["outcome"]) == (200, "done", "accepted")
    end = done["end"]
    assert (end["how"], end["why"]) == ("reached", "")
    now = watcher.query(answers.State)
    assert (end["q"], end["gripper"], end["T"]) == (now.q, now.gripper, now.T)
    assert (now.q, now.gripper) == (now.goal, now.gripper_goal)
    assert (now.q, now.gripper) != (began.q, began.gripper)
    # Longer than the driver may be silent, and the lease is free at once.
    assert end["seconds"] > 0.25
    assert (now.holder, now.stopped, now.moving) == (None, None, False)


@pytest.mark.long
def test_a_motion_longer_than_the_lease_of_a_silent_program_is_supervised(
    server: AppServer, watcher: Client
) -> None:
    with moving(server, watcher, q=[2.5, *READY[1:].tolist()]) as answer:
        time.sleep(3.5)
        now = watcher.query(answers.State)
        assert now.moving
        assert now.holder == "Program"
        with pytest.raises(RefusedError, match="holds the arm"):
            watcher.ask(requests.Home())
    assert answer.result()[1]["end"]["how"] == "reached"
    assert answer.result()[1]["end"]["seconds"] > 3.5
    check_nothing_moves_later(watcher)


def test_target_that_the_arm_cannot_reach_is_limited(server: AppServer, watcher: Client) -> None:
    status, done = post(server, do="joint", axis=5, value=40.0, wait=30)
    assert (status, done["outcome"], done["end"]["how"]) == (200, "limited", "limited")
    assert "Axis 5 at its limit" in done["end"]["why"]
    assert watcher.query(answers.State).holder is None


def test_stop_of_anybody_ends_the_wait(server: AppServer, watcher: Client) -> None:
    with moving(server, watcher) as answer:
        watcher.stop()
    status, done = answer.result()
    assert (status, done["end"]["how"]) == (409, "stopped")
    assert done["end"]["why"] == watcher.query(answers.State).stopped
    assert done["end"]["q"] == watcher.query(answers.State).q
    assert done["end"]["q"] != pytest.approx(THERE.tolist(), abs=1e-3)
    check_nothing_moves_later(watcher)
    assert post(server, do="home", wait=10)[0] == 409
    watcher.clear_stop()


def test_closed_connection_stops_the_arm(server: AppServer, watcher: Client) -> None:
    slow(watcher)
    body = json.dumps({"do": "joints", "q": THERE.tolist(), "wait": 30}).encode()
    head = (
        f"POST /api/v1/do HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nX-Name: Broken\r\n"
        f"X-Program: a-program-that-leaves\r\nContent-Length: {len(body)}\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", server.port)) as line:
        line.sendall(head.encode() + body)
        wait_for(watcher, under_way)
    stopped = wait_for(watcher, lambda now: now.stopped is not None, 0.5)
    assert stopped.stopped == "Broken left while the arm moved."
    check_nothing_moves_later(watcher)
    watcher.clear_stop()


def test_contact_ends_the_wait_and_drops_the_target(server: AppServer, watcher: Client) -> None:
    with wall(watcher, (0.25, 0.3, 0.0), [0.05, 0.3, 0.5]):
        status, done = post(server, do="joint", axis=1, value=1.2, wait=30)
        assert (status, done["end"]["how"]) == (409, "contact")
        assert "wall" in done["end"]["why"]
    # Without its target the arm stays where it is when the wall is gone.
    check_nothing_moves_later(watcher)


def test_pause_ends_the_wait(server: AppServer, watcher: Client) -> None:
    with moving(server, watcher) as answer:
        assert post(server, do="pause")[0] == 200
    status, done = answer.result()
    assert (status, done["end"]["how"]) == (409, "paused")
    assert "paused" in done["end"]["why"].lower()
    assert post(server, do="release_lease")[0] == 200
    check_nothing_moves_later(watcher)
    with connect(server.url) as program:
        program.ask(requests.Resume())
        program.ask(requests.ReleaseLease())


@pytest.mark.long
def test_newer_command_of_the_same_program_supersedes(server: AppServer, watcher: Client) -> None:
    with moving(server, watcher) as answer:
        status, home = post(server, do="home", wait=30)
    assert (status, home["end"]["how"]) == (200, "reached")
    status, done = answer.result()
    assert (status, done["end"]["how"]) == (409, "superseded")
    np.testing.assert_allclose(home["end"]["q"], READY, rtol=0, atol=1e-12)
    check_nothing_moves_later(watcher)


@pytest.mark.long
def test_admin_who_takes_the_lease_ends_the_wait(server: AppServer, watcher: Client) -> None:
    with moving(server, watcher) as answer:
        watcher.ask(requests.Take())
    status, done = answer.result()
    assert (status, done["end"]["how"]) == (409, "lease lost")
    watcher.ask(requests.ReleaseLease())
    check_nothing_moves_later(watcher)


def test_disconnected_program_is_stopped(server: AppServer, watcher: Client) -> None:
    with moving(server, watcher) as answer:
        (person,) = (each.person for each in watcher.people() if each.drives)
        watcher.kick(person, 60.0)
    watcher.kick(person, 0.0)
    status, refused = answer.result()
    assert (status, refused["is"]) == (409, "refused")
    assert refused["why"] == "An admin has disconnected you."
    assert watcher.query(answers.State).stopped == "Program left while the arm moved."
    check_nothing_moves_later(watcher)
    watcher.clear_stop()


def test_time_that_is_up_brings_the_arm_to_rest(server: AppServer, watcher: Client) -> None:
    slow(watcher)
    status, done = post(server, do="joints", q=[2.5, *READY[1:].tolist()], wait=0.7)
    assert (status, done["end"]["how"]) == (409, "timeout")
    assert done["end"]["why"] == "The motion did not end within 0.7 s."
    assert done["end"]["q"] == watcher.query(answers.State).q
    assert watcher.query(answers.State).stopped is None
    check_nothing_moves_later(watcher)


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        ({"do": "home", "wait": 0}, "Expected `float` >= 0.1"),
        ({"do": "home", "wait": -1}, "Expected `float` >= 0.1"),
        ({"do": "home", "wait": 601}, "Expected `float` <= 600"),
        ({"do": "home", "wait": True}, "got `bool`"),
        ({"do": "home", "wait": "10"}, "got `str`"),
        ({"do": "servo", "q": READY.tolist(), "wait": 5}, "unknown field `wait`"),
        ({"do": "jog", "rates": [0, 0, 0, 0, 0], "wait": 5}, "unknown field `wait`"),
        ({"do": "stop", "wait": 5}, "unknown field `wait`"),
        ({"do": "query", "wait": 5}, "unknown field `wait`"),
        ({"do": "acquire", "wait": 5}, "unknown field `wait`"),
    ],
)
def test_bad_wait_is_refused_at_the_entrance(
    server: AppServer, watcher: Client, request_: dict[str, Any], why: str
) -> None:
    status, refused = post(server, **request_)
    assert (status, refused["is"]) == (422, "refused")
    assert why in refused["why"]
    with speaking(server) as lines:
        assert why in lines.answer(**request_)["why"]
    assert watcher.query(answers.State).holder is None


def test_refused_request_gives_the_lease_back(server: AppServer, watcher: Client) -> None:
    status, refused = post(server, do="joints", q=[0.0], wait=5)
    assert (status, refused["is"]) == (409, "refused") or status == 422
    assert "5 joints" in refused["why"]
    assert watcher.query(answers.State).holder is None


def test_json_lines_and_websocket_have_the_same_wait(server: AppServer, watcher: Client) -> None:
    slow(watcher)
    with speaking(server, "Simple") as lines:
        # No heartbeat is sent until the answer comes, and no `id` is needed.
        lines.say(do="joints", q=THERE.tolist(), wait=30)
        heard = lines.hear()
        assert (heard["is"], heard["end"]["how"]) == ("done", "reached")
        assert watcher.query(answers.State).holder is None
        # A lease that was acquired before is kept.
        assert lines.answer(do="acquire")["is"] == "done"
        assert lines.answer(do="nudge", axis=1, by=0.1, wait=30)["end"]["how"] == "reached"
        assert watcher.query(answers.State).holder == "Simple"
        assert lines.answer(do="release_lease")["is"] == "done"
    done = watcher.ask(requests.Home(wait=30))
    assert isinstance(done, answers.Done)
    assert done.end is not None
    assert done.end.how == "reached"
    assert watcher.query(answers.State).holder is None


@pytest.mark.long
def test_closed_line_stops_the_arm(server: AppServer, watcher: Client) -> None:
    slow(watcher)
    with speaking(server, "Broken") as lines:
        lines.say(do="joints", q=THERE.tolist(), wait=30)
        wait_for(watcher, under_way)
    wait_for(watcher, lambda now: now.stopped == "Broken left while the arm moved.", 1.0)
    watcher.clear_stop()


@pytest.mark.long
def test_number_of_open_requests_is_bounded(server: AppServer, watcher: Client) -> None:
    slow(watcher)
    with speaking(server) as lines:
        for number in range(9):
            lines.say(do="gripper", angle=0.3, wait=30, id=number)
        refused = lines.hear()
        assert (refused["is"], refused["id"]) == ("refused", 8)
        assert {lines.hear()["end"]["how"] for _ in range(8)} == {"reached"}
        lines.answer(do="gripper", angle=0.0, wait=30)


@pytest.mark.long
def test_planned_path_is_waited_for(server: AppServer, watcher: Client) -> None:
    q = np.deg2rad((0.0, -68.0, 85.0, 40.0, 0.0)).tolist()
    assert post(server, do="joints", q=q, wait=30)[1]["end"]["how"] == "reached"
    status, done = post(server, do="branch", shoulder="back", elbow="up", wait=60)
    assert (status, done["end"]["how"]) == (200, "reached")
    assert watcher.query(answers.State).branch == ("back", "up")
    assert post(server, do="joints", q=q, wait=60)[1]["end"]["how"] == "reached"
    with wall(watcher, (-0.1, 0.0, 0.4), [0.05, 0.3, 0.6]):
        status, done = post(server, do="branch", shoulder="back", elbow="up", wait=60)
        assert (status, done["end"]["how"]) == (409, "failed")
        assert "No path around the obstacles" in done["end"]["why"]
        assert done["end"]["q"] == watcher.query(answers.State).q == pytest.approx(q)
        # The failure does not count for the next motion.
        assert post(server, do="home", wait=60)[1]["end"]["how"] == "reached"


def test_limit_of_the_fingers_does_not_count_for_the_arm(
    server: AppServer, watcher: Client
) -> None:
    status, done = post(server, do="gripper", angle=0.9, wait=30)
    assert (status, done["end"]["how"]) == (200, "limited")
    assert "gripper at its limit" in done["end"]["why"]
    assert post(server, do="nudge", axis=1, by=0.1, wait=30)[1]["end"]["how"] == "reached"
    assert post(server, do="gripper", angle=0.0, wait=30)[1]["end"]["how"] == "reached"
    assert watcher.query(answers.State).gripper == 0.0


SCRIPT = """\
name: Two
steps:
  - joints: [20, -68, 85, 8, 0]
  - joints: [-20, -68, 85, 8, 0]
"""


def test_program_is_one_request_too(server: AppServer, watcher: Client) -> None:
    assert post(server, do="program", text=SCRIPT)[0] == 200
    status, done = post(server, do="steer", order="run", wait=60)
    assert (status, done["end"]["how"], done["end"]["why"]) == (200, "reached", "")
    assert done["end"]["q"][0] == pytest.approx(np.deg2rad(-20.0))
    assert done["end"]["seconds"] > 1.0
    check_nothing_moves_later(watcher)


@pytest.mark.long
def test_end_of_a_program_that_does_not_reach_its_end_is_honest(
    server: AppServer, watcher: Client
) -> None:
    slow(watcher)
    assert post(server, do="program", text=SCRIPT)[0] == 200
    status, done = post(server, do="steer", order="run", wait=1.5)
    assert (status, done["end"]["how"]) == (409, "timeout")
    check_nothing_moves_later(watcher)
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(lambda: post(server, do="steer", order="run", wait=60))
        wait_for(watcher, under_way, 20.0)
        watcher.stop()
        assert (answer.result()[0], answer.result()[1]["end"]["how"]) == (409, "stopped")
    watcher.clear_stop()
    assert post(server, do="program", text=SCRIPT.replace("85", "999"))[0] == 200
    status, done = post(server, do="steer", order="run", wait=30)
    assert status == 409
    assert "line 3" in json.dumps(done)


def test_without_wait_the_program_falls_silent(server: AppServer, watcher: Client) -> None:
    slow(watcher)
    done: list[Any] = []
    threading.Thread(
        target=lambda: done.append(
            ask(
                f"{server.url}/api/v1/do",
                data=json.dumps({"do": "joints", "q": THERE.tolist()}).encode(),
                X_Program="a-silent-program",
                X_Name="By hand",
            )
        )
    ).start()
    now = wait_for(watcher, lambda now: now.stopped is not None)
    # A machine that others load is named instead.
    assert now.stopped is not None
    assert now.stopped == "By hand fell silent while the arm moved." or "too busy" in now.stopped
    wait_for(watcher, lambda now: now.holder is None)
    watcher.clear_stop()


@pytest.mark.long
def test_simulated_arm_names_the_silence_too() -> None:
    with AppServer(SIMULATION_APP) as server, connect(server.url, "Watcher") as watcher:
        slow(watcher)
        assert post(server, do="joints", q=THERE.tolist())[0] == 200
        paused = wait_for(watcher, lambda now: now.status == "paused")
        # A machine that others load is named instead.
        assert "the driver fell silent" in paused.why or "too busy" in paused.why
        stopped = wait_for(watcher, lambda now: now.stopped is not None, 8.0)
        assert stopped.stopped == "Program was silent for 5 s."
