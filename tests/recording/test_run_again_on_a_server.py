"""A real server records a motion and runs it again: the same setpoints, and STOP ends it."""

from __future__ import annotations

import asyncio
import time
from argparse import Namespace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from starlette.exceptions import HTTPException
from starlette.requests import Request

import katana450
from katana450.arm.control.lease import Role
from katana450.cli.main import main
from katana450.client import RefusedError
from katana450.extensions.programs.script.script import parse
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live.jobs import RecordingRoutes
from katana450.extensions.recording.playback.store import RecordingStore
from katana450.extensions.recording.run_again import check_same_arm
from katana450.resources import URDF_PATH
from katana450.server.api import answers, requests
from katana450.server.service.identity import Identity
from katana450.server.web.http_api import RouteContext
from tests.browser.server import AppServer
from tests.gateway.client import ask, enter
from tests.recording.recorded import described
from tests.waiting import until

TARGETS = ((0.33, 0.05, 0.08), (0.28, -0.04, 0.03), (0.3, 0.0, 0.06))


@pytest.fixture(scope="module")
def recorded(
    shared_server: AppServer, server_folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A drag through TARGETS, as the server has recorded it."""
    path = tmp_path_factory.mktemp("kept") / "drag.mcap"
    with katana450.connect(shared_server.url, "Ada") as client:
        for target in TARGETS:
            client.go(requests.Position(p=np.array(target)))
        end = client.query(answers.State).q

        def kept() -> bool:
            try:
                path.write_bytes(client.recording())
            except RefusedError:
                return False
            return bool(np.abs(katana450.open(path).setpoint[-1] - end).max() < 1e-9)

        # Each request for a recording starts a process, and a second later it is complete.
        until(lambda: recordings_in(server_folder / "ring"))
        time.sleep(1.0)
        until(kept, 60.0)
    return path


@pytest.mark.long
def test_recorded_drag_runs_again(
    shared_server: AppServer, recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["record", "again", str(recorded), "--url", shared_server.url]) == 0
    printed = capsys.readouterr().out
    assert "Again drag.mcap: " in printed
    with katana450.connect(shared_server.url, "Ada") as client:
        end = client.query(answers.State).q
    assert np.abs(katana450.open(recorded).setpoint[-1] - end).max() < 1e-6


def test_arm_continues_from_a_moment_of_a_file_and_of_the_last_minutes(
    shared_server: AppServer, recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, url = katana450.open(recorded), shared_server.url
    # In the last motion.
    t = float(run.t[-50] - run.start)
    q, end = run.fork(t).state.q, run.setpoint[-1]
    with katana450.connect(url, "Ada") as client:
        state = client.fork(t, recorded)
        assert np.abs(state.q - q).max() < 0.5 * np.abs(end - q).max()
        assert np.abs(client.fork(run.start + run.utc_offset + t, wait=20.0).q - end).max() < 1e-6
        with pytest.raises(RefusedError, match="no longer has that recording"):
            client.ask(requests.ContinueFrom(t=t, of="0123"))
        with pytest.raises(RefusedError, match="Nothing complete is recorded"):
            client.fork(1.0)
        with katana450.connect(url, "Bea") as other, pytest.raises(RefusedError, match="Ada"):
            other.fork(t, recorded)
        client.home()
    command = ["record", "fork", str(recorded), "--url", url, "--at"]
    assert main([*command, f"{t}"]) == 0
    assert capsys.readouterr().out.endswith("The arm is at rest.\n")
    with katana450.connect(url, "Ada") as client:
        assert np.abs(client.query(answers.State).q - end).max() < 1e-6
    assert main([*command, "999"]) == 1
    assert "s long, so it has no moment 999 s" in capsys.readouterr().err


def test_script_of_the_last_seconds_is_served(shared_server: AppServer, recorded: Path) -> None:
    address, cookie = f"{shared_server.url}/api/v1/recording/script", enter(shared_server.url)
    for query, status in (("?from=-1", 400), ("?to=x", 400), ("?from=9e9", 409), ("", 200)):
        answer = ask(address + query, Cookie=cookie)
        assert answer[0] == status, answer[2]
    script = parse(answer[2].decode())
    assert [located.step.__class__.__name__ for located in script.steps][-1] == "FollowTrajectory"
    assert len(katana450.open(recorded).t) > 100


def test_script_is_made_for_the_robot_of_the_server_only(recorded: Path, tmp_path: Path) -> None:
    """A page may open a recording of another robot than that of ``serve --urdf``."""
    other = tmp_path / "other.urdf"
    other.write_bytes(URDF_PATH.read_bytes() + b"<!-- another -->")
    options = Namespace(urdf=other)
    ada = Identity("session", "Ada", Role.OPERATOR)
    context = RouteContext(None, None, lambda _: ada, None, options)  # type: ignore[arg-type]
    store = RecordingStore(recorded.parent)
    request = Request({"type": "http", "query_string": b"", "headers": []})
    with pytest.raises(HTTPException, match="is a recording of") as caught:
        asyncio.run(RecordingRoutes(context, store).routes()[1].endpoint(request))
    assert caught.value.status_code == 409


@pytest.mark.long
def test_server_with_another_arm_is_refused(shared_server: AppServer, recorded: Path) -> None:
    with katana450.connect(shared_server.url, "Ada") as client:
        arm = client.query(answers.Arm)
        other = msgspec.structs.replace(arm, upper=[angle + 0.1 for angle in arm.upper])

        class OtherArm:
            """The client of a server whose joints go farther; it takes no script."""

            def query(self, kind: type[answers.Arm]) -> answers.Arm:
                assert kind is answers.Arm
                return other

        with pytest.raises(katana450.InputError, match="joint limits or tool frames differ"):
            check_same_arm(OtherArm(), described().session.require_arm(), recorded)  # type: ignore[arg-type]
