"""Programs at the door of a real server: over a websocket, over HTTP, over a TCP port."""

from __future__ import annotations

import asyncio
import json
import math
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.weight import loads_of
from katana450.cli.main import main
from katana450.client import AsyncClient, Client, RefusedError, aconnect, connect
from katana450.client.files import LostError
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.reading import Reading
from katana450.maths.kinematics.statics import holding_torques
from katana450.maths.kinematics.velocity import limit_distances
from katana450.server.api import answers, requests, schema
from katana450.server.api.fields import Matrix4
from tests.browser.server import APP, AppServer, free_port
from tests.gateway.client import ask, websocket
from tests.gateway.lines import Lines, post, speaking

READY = np.deg2rad((0.0, -68.0, 85.0, 8.0, 0.0))
THERE = np.deg2rad((20.0, -60.0, 80.0, 20.0, -30.0))


def test_a_program_drives_the_joints_and_knows_when_they_are_there(
    program: Client, arm: MountedArm
) -> None:
    there = program.joints(THERE)
    assert there.status == "ok"
    assert there.why == ""
    np.testing.assert_allclose(there.q, THERE, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.array(there.T), forward(arm.chain, THERE), rtol=0, atol=1e-12)
    assert there.holder == program.welcome.name == "Test"
    described = program.query(answers.Arm)
    assert described.joints == list(arm.chain.names)
    np.testing.assert_array_equal(described.ready, READY)
    np.testing.assert_array_equal(described.T_base_shoulder, arm.T_base_shoulder)


@pytest.mark.parametrize("frame", list(requests.Frame))
def test_a_pose_may_be_in_either_frame(
    program: Client, arm: MountedArm, frame: requests.Frame
) -> None:
    T = forward(arm.chain, THERE)
    asked = T if frame is requests.Frame.SHOULDER else arm.T_base_shoulder @ T
    there = program.go(requests.Pose(T=asked.tolist(), frame=frame))
    np.testing.assert_allclose(np.array(there.T), T, rtol=0, atol=1e-9)
    p = asked[:3, 3] + [0.0, 0.0, 0.02]
    there = program.go(requests.Position(p=tuple(p), frame=frame))
    np.testing.assert_allclose(np.array(there.T)[:3, 3], T[:3, 3] + [0, 0, 0.02], rtol=0, atol=1e-9)
    assert there.pitch is not None
    there = program.go(requests.Turn(pitch=there.pitch, roll=0.25))
    assert there.roll == pytest.approx(0.25, abs=1e-12)


def test_what_the_arm_cannot_do_comes_with_its_reason(program: Client) -> None:
    there = program.go(requests.Position(p=(0.9, 0.0, 0.0)))
    assert there.status == "limited"
    assert there.findings[0].reason == "out of reach"
    assert there.findings[0].unit == "m"
    assert there.findings[0].amount == pytest.approx(
        0.9 - math.hypot(*np.array(there.T)[:3, 3]), abs=0.02
    )
    with pytest.raises(RefusedError, match="There is no tool 'spoon'; this arm has"):
        program.ask(requests.Tool(name="spoon"))
    with pytest.raises(RefusedError, match="5 joints, the command 3"):
        program.ask(requests.Joints(q=[0.0, 0.0, 0.0]))
    skewed = ((1.0, 0.0, 0.0, 0.3), (0.0, 1.0, 0.5, 0.0), (0.0, 0.0, 1.0, 0.0), (0, 0, 0, 1.0))
    with pytest.raises(RefusedError, match=r"[Rr]otation"):
        program.ask(requests.Pose(T=skewed))


def test_everything_there_is_to_ask_for_has_an_answer(program: Client) -> None:
    asked: list[requests.Request] = [
        requests.Heartbeat(n=3), requests.Gripper(angle=0.1), requests.Tool(name="flange"),
        requests.Tool(name="tcp"), requests.Joint(axis=5, value=0.1), requests.Pause(),
        requests.Resume(), requests.EndDrag(), requests.Hold(), requests.GoToZero(),
        requests.Home(), requests.Jog(rates=(0.0, 0.0, 0.05, 0.0, 0.0)),
        requests.Servo(q=READY.tolist()), requests.Fill(ml=150.0), requests.Query(at="loop"),
        requests.Branch(shoulder="front", elbow="up"), requests.Watch(hz=0.0),
        *(requests.Read(reading=each) for each in reversed(Reading)),
    ]  # fmt: skip
    for request in asked:
        answer = program.ask(request)
        assert not isinstance(answer, answers.Refused), request
    for kind in (answers.State, answers.Arm, answers.Ledger, answers.Branches, answers.Loop):
        assert isinstance(program.query(kind), kind)
    refusals = (requests.Acquire(), requests.Take(), requests.Ask(), requests.Withdraw())
    for request in refusals:
        with pytest.raises(RefusedError):
            program.ask(request)


def test_a_state_tells_what_follows_from_the_posture(
    program: Client, robot: Robot, arm: MountedArm
) -> None:
    q = THERE + np.array((0.3, 0.0, 0.0, 0.0, 0.0))
    program.joints(q)
    time.sleep(0.3)
    state = program.query(answers.State)
    assert state.told > state.t + 0.2
    assert (state.setpoint, state.tool_speed) == (state.q, 0.0)
    assert (state.touching, state.held) == ([], None)
    assert state.holding == pytest.approx(holding_torques(arm.chain, q, loads_of(robot)))
    distances = limit_distances(arm.chain, q)
    assert state.margins is not None
    assert state.margins.limit == pytest.approx(distances.min())
    assert state.margins.axis == distances.argmin() + 1
    assert state.margins.clearance is not None
    assert state.margins.clearance > 0.005
    program.tell(requests.Joints(q=THERE.tolist()))
    deadline = time.monotonic() + 5.0
    while (program.query(answers.State).tool_speed or 0.0) < 0.05:
        assert time.monotonic() < deadline


def test_a_stream_of_joints_is_followed_and_its_end_is_a_rest(program: Client) -> None:
    began = time.monotonic()
    while (t := time.monotonic() - began) < 1.5:
        wave = READY + math.sin(2.0 * t) * np.array((0.2, 0.0, 0.0, 0.0, 0.4))
        program.tell(requests.Servo(q=wave.tolist()))
        time.sleep(0.02)
    moving = program.query(answers.State)
    assert abs(np.array(moving.qd)[0]) > 0.05
    time.sleep(1.2)
    rest = program.query(answers.State)
    assert not rest.moving
    # It braked at once and did not go on to where the stream had wanted it.
    assert abs(rest.q[0] - 0.2 * math.sin(2.0 * 1.5)) < 0.2
    # A target of another kind stays until it is reached.
    there = program.joints(THERE)
    np.testing.assert_allclose(there.q, THERE, rtol=0, atol=1e-12)


@pytest.mark.parametrize("rates", [False, True])
def test_a_stream_inside_the_limits_is_not_overshot(program: Client, rates: bool) -> None:
    """It uses 0.7 of the acceleration; the bounds leave room for a busy machine."""
    began, size, omega, seen = time.monotonic(), 0.4, math.tau / 3.0, [0.0]
    while (t := time.monotonic() - began) < 6.5:
        q, qd = READY.copy(), np.zeros(5)
        q[0] += size * math.sin(omega * t)
        qd[0] = size * omega * math.cos(omega * t)
        program.tell(requests.Servo(q=q.tolist(), qd=qd.tolist() if rates else None))
        seen.append(program.query(answers.State).setpoint[0] - READY[0])
        time.sleep(max(0.0, began + t + 0.02 - time.monotonic()))
    assert 0.9 * size < max(abs(each) for each in seen) < 1.05 * size


def test_states_come_as_often_as_they_are_wanted(program: Client) -> None:
    times = []
    for state in program.states(hz=50.0):
        times.append(time.monotonic())
        assert len(state.q) == 5
        if len(times) == 60:
            break
    # A busy machine may tell fewer, never more.
    assert 0.019 < np.mean(np.diff(times)) < 0.04


def test_stop_is_anybodys_and_ends_what_a_program_does(server: AppServer, program: Client) -> None:
    program.ask(requests.Speed(value=0.2))
    program.ask(requests.Joints(q=THERE.tolist()))
    with connect(server.url, "Watcher") as other, pytest.raises(RefusedError, match=r"Test.*holds"):
        other.ask(requests.Home())
    status, _, _ = ask(f"{server.url}/api/v1/stop", data=b"", X_Name="bystander")
    assert status == 204
    assert program.query(answers.State).stopped == "bystander pressed STOP."
    with pytest.raises(RefusedError, match="clear the stop first"):
        program.joints(READY)
    while (rest := program.query(answers.State)).moving:
        time.sleep(0.02)
    program.ask(requests.ClearStop())
    time.sleep(0.3)
    assert program.query(answers.State).q == rest.q
    ledger = program.query(answers.Ledger)
    assert any(line.who == "bystander" and line.began for line in ledger.lines)


def test_a_program_that_falls_silent_stops_the_arm(server: AppServer) -> None:
    async def act() -> None:
        async with (
            websocket(server.url, "/api/v1/socket?name=Frozen") as silent,
            aconnect(server.url, "Watcher") as watcher,
        ):
            await silent.send('{"do": "speed", "value": 0.1}')
            await silent.send(json.dumps({"do": "joints", "q": THERE.tolist()}))
            async with asyncio.timeout(5.0):
                while (await watcher.query(answers.State)).stopped is None:
                    await asyncio.sleep(0.02)
            state = await watcher.query(answers.State)
            assert state.stopped == "Frozen fell silent while the arm moved."
            await _freed(watcher)
            await watcher.ask(requests.ClearStop())
            await watcher.go(requests.Home())

    asyncio.run(act())


async def _freed(client: AsyncClient) -> None:
    async with asyncio.timeout(10.0):
        while (await client.query(answers.State)).holder is not None:
            await asyncio.sleep(0.05)


def test_a_line_of_json_at_a_time_does_the_same(server: AppServer) -> None:
    with speaking(server, "Octave") as lines:
        lines.answer(do="clear_stop")
        done = lines.answer(do="joints", q=THERE.tolist())
        assert done["is"] == "done"
        lines.say(do="watch", hz=20)
        state: dict[str, Any] = {"ticket": -1}
        while state["ticket"] < done["ticket"] or state["moving"]:
            # Whatever is asked is a sign of life.
            lines.say(do="heartbeat")
            while (state := lines.hear())["is"] != "state":
                pass
        np.testing.assert_allclose(state["q"], THERE, rtol=0, atol=1e-12)
        assert state["holder"] == "Octave"
        lines.say(do="watch", hz=0)
        assert "5 joints" in lines.answer(do="joints", q=[0])["why"]
        assert lines.answer(do="release_lease")["is"] == "done"


@pytest.mark.parametrize(
    "first",
    [
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b'POST / HTTP/1.1\r\n\r\n{"do":"stop"}\n',
        b'{"do": "stop"}\n',
        b'{"do": "hello"}\n',
        b"\xff\xfe\n",
        b"\n",
        b"x" * 100_000,
    ],
)
def test_who_does_not_say_hello_on_the_tcp_port_is_sent_away(
    server: AppServer, first: bytes
) -> None:
    lines = Lines(server)
    with lines.socket, lines.reader:
        with suppress(ConnectionError):
            lines.raw(first)
        assert lines.ends()
    with connect(server.url) as program:
        assert program.query(answers.State).stopped is None


def test_requests_that_are_none_change_nothing_and_end_the_line_after_a_while(
    server: AppServer,
) -> None:
    with connect(server.url) as watcher:
        before = watcher.query(answers.State)
        with speaking(server) as lines:
            for text in ("{", "[]", '{"do":"fly"}', '{"do":"joints","q":[NaN,0,0,0,0]}',
                         '{"do":"joints","q":[1e999,0,0,0,0],"id":4}', '{"do":"watch","hz":-1}',
                         '{"do":"joints"}', '{"do":"stop","now":true}'):  # fmt: skip
                lines.raw(text.encode() + b"\n")
                assert lines.hear()["is"] == "refused"
            lines.raw(b"{\n" * 60)
            assert lines.ends()
        after = watcher.query(answers.State)
        assert (after.q, after.holder, after.stopped) == (before.q, before.holder, before.stopped)


def test_single_requests_may_be_posted(server: AppServer) -> None:
    status, done = post(server, do="clear_stop", id=1)
    assert (status, done["is"], done["id"], done["outcome"]) == (200, "done", 1, "accepted")
    status, done = post(server, do="joint", axis=5, value=0.3)
    assert status == 200
    state: dict[str, Any] = {"ticket": 0}
    while state["ticket"] < done["ticket"] or state["moving"]:
        status, _, body = ask(f"{server.url}/api/v1/state", X_Program="a-test-that-posts")
        assert status == 200
        state = json.loads(body)
        assert state["stopped"] is None
        time.sleep(0.05)
    assert state["q"][4] == pytest.approx(0.3, abs=1e-12)
    status, said = post(server, "another-program-there", do="home", id="h")
    assert (status, said["is"], said["id"]) == (409, "refused", "h")
    assert "holds the arm" in said["why"]
    assert post(server, do="fly")[0] == 422
    assert post(server, do="watch", hz=3)[0] == 422
    assert post(server, "short", do="home")[0] == 422
    assert ask(f"{server.url}/api/v1/do", data=b"x" * 5000, X_Program="a-test-that-posts")[0] == 413
    assert post(server, do="release_lease")[0] == 200


def test_another_sites_page_cannot_speak_for_a_program(server: AppServer) -> None:
    for headers in ({"Origin": "https://evil.example"}, {"Origin": "null"}):
        status, _, _ = ask(
            f"{server.url}/api/v1/stop", data=b"", X_Program="a-test-that-posts", **headers
        )
        assert status == 403
    assert json.loads(ask(f"{server.url}/api/v1/state")[2])["stopped"] is None


def test_the_description_names_all_that_is_there(server: AppServer) -> None:
    described = json.loads(ask(f"{server.url}/api/v1/openapi.json")[2])
    for path in described["paths"]:
        data = b"{}" if path.endswith("do") else None
        status, _, _ = ask(server.url + path, data=data, X_Program="a-test-that-posts")
        assert status in (200, 405, 422), path
        assert set(described["paths"][path]) <= {"get", "post"}
    shapes = described["components"]["schemas"]
    for kind in (*schema.kinds(requests.AnyRequest), *schema.kinds(answers.AnyAnswer)):
        assert kind.__name__ in shapes


def test_where_a_link_is_asked_for_a_program_needs_a_token(tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "access.json"
    tokens = {}
    for role in ("viewer", "operator"):
        assert main(["access", "give", "--file", str(file), "--name", role, "--role", role]) == 0
        tokens[role] = capsys.readouterr().out.partition("#")[2].strip()
    port = free_port()
    with AppServer((*APP, "--access", str(file), "--lines", "0"), port=port) as server:
        for token in ("", "guess"):
            with pytest.raises((RefusedError, LostError)), connect(server.url, token=token):
                pass
        assert ask(f"{server.url}/api/v1/state")[0] == 401
        assert ask(f"{server.url}/api/v1/stop", data=b"", Authorization="Bearer x")[0] == 401
        with connect(server.url, "script", token=tokens["viewer"]) as watcher:
            assert (watcher.welcome.name, watcher.welcome.role) == ("viewer, script", "viewer")
            with pytest.raises(RefusedError, match="may only watch"):
                watcher.ask(requests.Home())
            with connect(server.url, "script", token=tokens["operator"]) as driver:
                assert driver.joints(THERE).status == "ok"
                with pytest.raises(RefusedError):
                    driver.ask(requests.Take())
        lines = Lines(server)
        with lines.socket, lines.reader:
            lines.say(do="hello", name="x")
            assert lines.hear()["is"] == "refused"
            assert lines.ends()
        lines = Lines(server)
        with lines.socket, lines.reader:
            lines.say(do="hello", name="x", token=tokens["operator"])
            assert lines.hear()["name"] == "operator, x"


def _rows(T: npt.ArrayLike) -> Matrix4:
    rows: Matrix4 = msgspec.convert(np.asarray(T).tolist(), Matrix4)
    return rows


def test_things_are_put_elsewhere_and_met_and_taken_away(program: Client) -> None:
    known = {each.name: each for each in program.query(answers.Things).things}
    assert set(known) == {"cup", "basin"}
    T = np.array(known["cup"].T)
    T[:2, 3] = (0.1, -0.45)
    program.ask(requests.Place(name="cup", T=_rows(T)))
    wall = np.eye(4)
    wall[:3, 3] = (0.25, 0.3, 0.0)
    program.ask(
        requests.Place(name="wall", T=_rows(wall), form=requests.Form.BOX, size=[0.05, 0.3, 0.5])
    )
    met = program.go(requests.Joint(axis=1, value=1.2))
    assert met.status == "blocked"
    assert "wall" in (met.findings[0].parts or ())
    assert "wall" in met.why
    program.ask(requests.Remove(name="wall"))
    assert program.go(requests.Joint(axis=1, value=1.2)).status == "ok"
    now = {each.name: each for each in program.query(answers.Things).things}
    assert set(now) == {"cup", "basin"}
    np.testing.assert_array_equal(now["cup"].T, T)
    beyond_the_table = T.copy()
    beyond_the_table[:2, 3] = (1.5, 0.0)
    for wrong in (
        requests.Place(name="ball", T=_rows(wall)),
        requests.Place(name="ball", T=_rows(wall), form=requests.Form.BOX, size=[0.1]),
        requests.Place(name="table", T=_rows(wall)),
        requests.Place(name="wrist_link", T=_rows(wall), form=requests.Form.SPHERE, size=[0.1]),
        requests.Place(name="cup", T=_rows(np.zeros((4, 4)))),
        requests.Place(name="cup", T=_rows(beyond_the_table)),
    ):
        with pytest.raises(RefusedError):
            program.ask(wrong)
    program.ask(requests.Place(name="cup", T=_rows(known["cup"].T)))


def test_another_branch_is_taken_on_a_way_that_is_clear(program: Client) -> None:
    program.joints(np.deg2rad((0.0, -68.0, 85.0, 40.0, 0.0)))
    there = program.go(requests.Branch(shoulder="front", elbow="down"))
    assert there.branch == ("front", "down")
    assert there.status == "ok"
    back = program.go(requests.Branch(shoulder="front", elbow="up"))
    assert back.branch == ("front", "up")
    # A STOP while the way is being worked out ends that too.
    program.ask(requests.Branch(shoulder="front", elbow="down"))
    program.ask(requests.Stop())
    program.ask(requests.ClearStop())
    time.sleep(2.0)
    rest = program.query(answers.State)
    assert not rest.moving
    assert rest.q == back.q
