"""Test requests with `wait`: one request makes one whole motion and is answered at its end."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.lease import Role
from katana450.client import Client, RefusedError
from katana450.maths.geometry import se3
from katana450.server.api import answers, requests
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import EXPIRED
from tests.gateway.client import HOUR
from tests.gateway.postures import READY, THERE
from tests.gateway.virtual import VirtualServer
from tests.waiting import state_when


@pytest.fixture
def watcher(local: VirtualServer) -> Iterator[Client]:
    """Connect a program that does not drive."""
    with local.connect("Watcher") as watcher:
        yield watcher


def slow(watcher: Client) -> None:
    """Make motions slow, so that they last longer than a driver may be silent."""
    watcher.ask(requests.Speed(value=0.2))
    watcher.ask(requests.ReleaseLease())


@contextmanager
def moving(
    local: VirtualServer, watcher: Client, **request: Any
) -> Iterator[Callable[[], tuple[int, Any]]]:
    """Send a request with `wait` over HTTP; enter the block once the arm moves, with its answer."""
    slow(watcher)
    request_fields = {"do": "joints", "q": THERE.tolist(), "wait": 30} | request
    request_fields = {name: value for name, value in request_fields.items() if value is not None}
    answer = local.loop.create_task(local.posted("a-test-that-posts", **request_fields))
    state_when(watcher, under_way)
    yield lambda: local.run(wait_of(answer))


async def wait_of(task: asyncio.Task[Any]) -> Any:
    return await task


@contextmanager
def wall(watcher: Client, place: tuple[float, float, float], size: list[float]) -> Iterator[None]:
    """Place a box in the base frame [m] inside the block."""
    x, y, z = place
    T = se3.from_rotation_translation(np.eye(3), np.array((x, y, z)))
    watcher.ask(requests.Place(name="wall", T=T, shape=requests.Shape.BOX, size=size))
    watcher.ask(requests.ReleaseLease())
    yield
    watcher.ask(requests.Remove(name="wall"))
    watcher.ask(requests.ReleaseLease())


def under_way(now: answers.State) -> bool:
    """Return whether the arm moves indeed; ``moving`` includes commands that wait."""
    return (now.tool_speed or 0.0) > 0.01


def check_nothing_moves_later(watcher: Client) -> None:
    """Check that the arm rests, has dropped its target, and stays where it is."""
    before = state_when(watcher, lambda now: not now.moving)
    time.sleep(0.5)
    after = watcher.query(answers.State)
    assert after.q == before.q == after.goal
    assert after.holder is None


def test_one_request_over_http_makes_one_whole_motion(
    local: VirtualServer, watcher: Client
) -> None:
    slow(watcher)
    bodies: list[dict[str, Any]] = [
        {"do": "joints", "q": THERE.tolist()},
        {"do": "joint", "axis": 1, "value": 0.5},
        {"do": "nudge", "axis": 1, "by": -0.4},
        {"do": "position", "p": [0.4, 0.1, 0.05]},
        {"do": "turn", "pitch": 0.3, "roll": 0.2},
        {"do": "step_tool", "by": [0.0, 0.0, 0.05, 0.0, 0.0]},
        {"do": "gripper", "angle": 0.2},
        {"do": "go_to_zero"},
        {"do": "set", "node": "axis_1", "field": "rotation", "value": [0, 0, 1, 0.6]},
    ]
    wrong = []
    for request in bodies:
        began = watcher.query(answers.State)
        status, done = local.post(**request, wait=60)
        end, now = done["end"], watcher.query(answers.State)
        shown = (now.q, now.gripper, now.T, now.goal, now.gripper_goal)
        ended = (end["q"], end["gripper"], end["T"], end["q"], end["gripper"])
        free = (now.holder, now.stopped, now.moving) == (None, None, False)
        moved = (now.q, now.gripper) != (began.q, began.gripper)
        whole = (status, done["outcome"], end["how"], end["why"]) == (
            200,
            "accepted",
            "reached",
            "",
        )
        # Longer than the driver may be silent, and the lease is free at once.
        if not (whole and moved and free and shown == ended and end["seconds"] > 0.25):
            wrong.append((request, done, now))
    assert wrong == []


def test_a_motion_longer_than_the_lease_of_a_silent_program_is_supervised(
    local: VirtualServer, watcher: Client
) -> None:
    with moving(local, watcher, q=[2.5, *READY[1:].tolist()]) as answer:
        time.sleep(3.5)
        now = watcher.query(answers.State)
        assert now.moving
        assert now.holder == "Program"
        with pytest.raises(RefusedError, match="holds the arm"):
            watcher.ask(requests.Home())
        assert answer()[1]["end"]["how"] == "reached"
        assert answer()[1]["end"]["seconds"] > 3.5
    check_nothing_moves_later(watcher)


def test_stop_of_anybody_ends_the_wait(local: VirtualServer, watcher: Client) -> None:
    with moving(local, watcher) as answer:
        watcher.stop()
    status, done = answer()
    assert (status, done["end"]["how"]) == (409, "stopped")
    assert done["end"]["why"] == watcher.query(answers.State).stopped
    assert done["end"]["q"] == watcher.query(answers.State).q
    assert done["end"]["q"] != pytest.approx(THERE.tolist(), abs=1e-3)
    check_nothing_moves_later(watcher)
    assert local.post(do="home", wait=10)[0] == 409
    watcher.clear_stop()


def test_closed_connection_stops_the_arm(local: VirtualServer, watcher: Client) -> None:
    slow(watcher)
    body = json.dumps({"do": "joints", "q": THERE.tolist(), "wait": 30}).encode()
    names: dict[str, Any] = {"X_Name": "Broken", "X_Program": "a-program-that-leaves"}
    leaves = asyncio.Event()
    sent = local.loop.create_task(local.request("/api/v1/do", body, leaves, **names))
    state_when(watcher, under_way)
    leaves.set()
    stopped = state_when(watcher, lambda now: now.stopped is not None, 0.1)
    assert stopped.stopped == "Broken left while the arm moved."
    assert sent.done()
    check_nothing_moves_later(watcher)
    watcher.clear_stop()


def test_contact_ends_the_wait_and_drops_the_target(local: VirtualServer, watcher: Client) -> None:
    with wall(watcher, (0.25, 0.3, 0.0), [0.05, 0.3, 0.5]):
        status, done = local.post(do="joint", axis=1, value=1.2, wait=30)
        assert (status, done["end"]["how"]) == (409, "contact")
        assert "wall" in done["end"]["why"]
    # Without its target the arm stays where it is when the wall is gone.
    check_nothing_moves_later(watcher)


def test_pause_ends_the_wait(local: VirtualServer, watcher: Client) -> None:
    with moving(local, watcher) as answer:
        assert local.post(do="pause")[0] == 200
    status, done = answer()
    assert (status, done["end"]["how"]) == (409, "paused")
    assert done["end"]["why"] == "Press Resume to continue."
    assert local.post(do="release_lease")[0] == 200
    check_nothing_moves_later(watcher)
    with local.connect() as program:
        program.ask(requests.Resume())
        program.ask(requests.ReleaseLease())


def test_newer_command_of_the_same_program_supersedes(
    local: VirtualServer, watcher: Client
) -> None:
    with moving(local, watcher) as answer:
        status, home = local.post(do="home", wait=30)
    assert (status, home["end"]["how"]) == (200, "reached")
    status, done = answer()
    assert (status, done["end"]["how"]) == (409, "superseded")
    np.testing.assert_allclose(home["end"]["q"], READY, rtol=0, atol=1e-12)
    check_nothing_moves_later(watcher)


def test_admin_who_takes_the_lease_ends_the_wait(local: VirtualServer, watcher: Client) -> None:
    with moving(local, watcher) as answer:
        watcher.ask(requests.Take())
    status, done = answer()
    assert (status, done["end"]["how"]) == (409, "lease lost")
    watcher.ask(requests.ReleaseLease())
    check_nothing_moves_later(watcher)


def test_program_whose_link_ends_is_stopped(guarded: VirtualServer, file: AccessFile) -> None:
    token, other = (file.give(name, Role.OPERATOR, time.time() + HOUR) for name in ("Oda", "Vera"))
    (number,) = (number for number, grant in file.grants.items() if grant.name == "Oda")
    body = json.dumps({"do": "joints", "q": THERE.tolist(), "wait": 30}).encode()
    names: dict[str, Any] = {
        "Authorization": f"Bearer {token}",
        "X_Program": "a-program-of-this-test",
    }
    with guarded.connect("Watcher", other) as watcher:
        slow(watcher)
        sent = guarded.loop.create_task(guarded.request("/api/v1/do", body, **names))
        state_when(watcher, under_way)
        file.revoke(number)
        status, _, refused = guarded.run(wait_of(sent))
        assert (status, json.loads(refused)["why"]) == (409, EXPIRED)
        assert watcher.query(answers.State).stopped == "Oda, Program left while the arm moved."
        check_nothing_moves_later(watcher)


def test_time_that_is_up_brings_the_arm_to_rest(local: VirtualServer, watcher: Client) -> None:
    slow(watcher)
    status, done = local.post(do="joints", q=[2.5, *READY[1:].tolist()], wait=0.7)
    assert (status, done["end"]["how"]) == (409, "timeout")
    assert done["end"]["why"] == "The motion did not end within 0.7 s."
    assert done["end"]["q"] == watcher.query(answers.State).q
    assert watcher.query(answers.State).stopped is None
    check_nothing_moves_later(watcher)


def test_bad_wait_is_refused_at_the_entrance(local: VirtualServer, watcher: Client) -> None:
    bad: list[tuple[dict[str, Any], str]] = [
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
    ]
    with local.speaking() as rows:
        for request, why in bad:
            status, refused = local.post(**request)
            assert (status, refused["is"]) == (422, "refused"), request
            assert why in refused["why"]
            assert why in rows.answer(**request)["why"]
            assert watcher.query(answers.State).holder is None


def test_refused_request_gives_the_lease_back(local: VirtualServer, watcher: Client) -> None:
    status, refused = local.post(do="joints", q=[0.0], wait=5)
    assert (status, refused["is"]) == (409, "refused") or status == 422
    assert "5 joints" in refused["why"]
    assert watcher.query(answers.State).holder is None


def test_json_lines_and_websocket_have_the_same_wait(local: VirtualServer, watcher: Client) -> None:
    slow(watcher)
    with local.speaking("Simple") as rows:
        # No heartbeat is sent until the answer comes, and no `id` is needed.
        rows.say(do="joints", q=THERE.tolist(), wait=30)
        heard = rows.hear()
        assert (heard["is"], heard["end"]["how"]) == ("done", "reached")
        assert watcher.query(answers.State).holder is None
        # A lease that was acquired before is kept.
        assert rows.answer(do="acquire")["is"] == "done"
        assert rows.answer(do="nudge", axis=1, by=0.1, wait=30)["end"]["how"] == "reached"
        assert watcher.query(answers.State).holder == "Simple"
        assert rows.answer(do="release_lease")["is"] == "done"
    done = watcher.ask(requests.Home(wait=30))
    assert isinstance(done, answers.Done)
    assert done.end is not None
    assert done.end.how == "reached"
    assert watcher.query(answers.State).holder is None


def test_number_of_open_requests_is_bounded(local: VirtualServer, watcher: Client) -> None:
    slow(watcher)
    with local.speaking() as rows:
        for number in range(9):
            rows.say(do="gripper", angle=0.3, wait=30, id=number)
        refused = rows.hear()
        assert (refused["is"], refused["id"]) == ("refused", 8)
        assert {rows.hear()["end"]["how"] for _ in range(8)} == {"reached"}
        rows.answer(do="gripper", angle=0.0, wait=30)


def test_refused_request_leaves_the_lease_to_the_one_that_waits(
    local: VirtualServer, watcher: Client
) -> None:
    with moving(local, watcher) as answer:
        assert local.post(do="joints", q=[0.0], wait=5)[0] == 422
        now = watcher.query(answers.State)
        assert (now.moving, now.holder) == (True, "Program")
        assert answer()[1]["end"]["how"] == "reached"
    assert watcher.query(answers.State).holder is None


@pytest.mark.long
def test_planned_path_is_waited_for(local: VirtualServer, watcher: Client) -> None:
    q = np.deg2rad((0.0, -68.0, 85.0, 40.0, 0.0)).tolist()
    assert local.post(do="joints", q=q, wait=30)[1]["end"]["how"] == "reached"
    status, done = local.post(do="branch", name="back-up", wait=60)
    assert (status, done["end"]["how"]) == (200, "reached")
    assert watcher.query(answers.State).branch == ("back", "up")
    assert local.post(do="joints", q=q, wait=60)[1]["end"]["how"] == "reached"
    with wall(watcher, (-0.1, 0.0, 0.4), [0.05, 0.3, 0.6]):
        status, done = local.post(do="branch", name="back-up", wait=60)
        assert (status, done["end"]["how"]) == (409, "failed")
        assert "No path around the obstacles" in done["end"]["why"]
        assert done["end"]["q"] == watcher.query(answers.State).q == pytest.approx(q)
        # The failure does not count for the next motion.
        assert local.post(do="home", wait=60)[1]["end"]["how"] == "reached"


def test_limit_of_the_fingers_does_not_count_for_the_arm(
    local: VirtualServer, watcher: Client
) -> None:
    status, done = local.post(do="gripper", angle=0.9, wait=30)
    assert (status, done["end"]["how"]) == (200, "limited")
    assert "gripper at its limit" in done["end"]["why"]
    assert local.post(do="nudge", axis=1, by=0.1, wait=30)[1]["end"]["how"] == "reached"
    assert local.post(do="gripper", angle=0.0, wait=30)[1]["end"]["how"] == "reached"
    assert watcher.query(answers.State).gripper == 0.0


SCRIPT = """\
name: Two
steps:
  - joints: [20, -68, 85, 8, 0]
  - joints: [-20, -68, 85, 8, 0]
"""


def test_program_is_one_request_too(local: VirtualServer, watcher: Client) -> None:
    assert local.post(do="program", text=SCRIPT)[0] == 200
    status, done = local.post(do="steer", order="run", wait=60)
    assert (status, done["end"]["how"], done["end"]["why"]) == (200, "reached", "")
    assert done["end"]["q"][0] == pytest.approx(np.deg2rad(-20.0))
    assert done["end"]["seconds"] > 1.0
    check_nothing_moves_later(watcher)


def test_end_of_a_program_that_does_not_reach_its_end_is_honest(
    local: VirtualServer, watcher: Client
) -> None:
    slow(watcher)
    assert local.post(do="program", text=SCRIPT)[0] == 200
    status, done = local.post(do="steer", order="run", wait=1.5)
    assert (status, done["end"]["how"]) == (409, "timeout")
    check_nothing_moves_later(watcher)
    with moving(local, watcher, do="steer", order="run", q=None) as answer:
        watcher.stop()
        assert (answer()[0], answer()[1]["end"]["how"]) == (409, "stopped")
    watcher.clear_stop()
    assert local.post(do="program", text=SCRIPT.replace("85", "999"))[0] == 200
    status, done = local.post(do="steer", order="run", wait=30)
    assert status == 409
    assert "line 3" in json.dumps(done)
