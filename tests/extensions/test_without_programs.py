"""Test a server without the extensions ``programs`` and ``water``: it drives and stops the arm."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.client import Client, RefusedError, connect
from katana450.server.api import answers, requests
from katana450.server.api.fields import ROOT
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from tests.browser.server import RECORDING_APP, AppServer
from tests.extensions.environments import distribution, without
from tests.gateway.client import ask
from tests.gateway.lines import post

THERE = [0.4, -1.1, 1.3, 0.3, 0.2]
FAR = [2.5, -1.1, 1.3, 0.3, 0.2]
# Without programs, the recording is left out with its options.
STRICT_APP = (*RECORDING_APP, "--strict-silence", "--silence", "2.0")

STATION = """
from katana450.arm.control import commands as cmd
from katana450.extension import Extension, ServeExtension

seen = []

def runner():
    from katana450.server.api.answers import Done, Progress
    from katana450.server.api.fields import COMMAND, Request
    from katana450.server.service.runner import Runner

    class Nod(Request, frozen=True, kw_only=True):
        "Nod, in another distribution's name."

        traits = COMMAND
        by: float

    class Nodder(Runner):
        request_types = (Nod,)

        def handle(self, window, request):
            seen.append(window.person.name)
            return Done(ticket=self.hub.move(window, cmd.Nudge(3, request.by)))

        def progress(self):
            return Progress(name="nods", by=seen[-1], status="done") if seen else None

        def stopped(self):
            raise ValueError("a fault in stopped")

        def redirected(self):
            raise ValueError("a fault in redirected")

    return Nodder

class Folder:
    def __init__(self, context):
        self.states = 0
        self.context = context
        self.label = context.server.gui.add_markdown("")

    def follow(self):
        self.states += 1
        self.label.content = f"{self.states} states of {self.context.state().tool}"

EXTENSION = Extension("nodding", serve=ServeExtension(runner=runner, folder=Folder))
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AppServer]:
    folder = tmp_path_factory.mktemp("blocking")
    with without(folder, "programs", "water"), AppServer(STRICT_APP) as server:
        yield server


@pytest.fixture
def arm(server: AppServer) -> Iterator[Client]:
    with connect(server.url, "Driver") as arm:
        yield arm
        arm.clear_stop()


def wait(arm: Client, until: Callable[[answers.State], bool]) -> answers.State:
    due = time.monotonic() + 20.0
    while not until(state := arm.query(answers.State)):
        assert time.monotonic() < due, state
        time.sleep(0.01)
    return state


def test_server_starts_and_drives(server: AppServer, arm: Client) -> None:
    state = arm.joints(THERE)
    assert state.why == ""
    assert np.abs(np.array(state.q) - THERE).max() < 1e-6
    assert state.holder == arm.welcome.name
    assert state.program is None
    assert arm.go(requests.Position(p=(0.4, 0.1, 0.05))).why == ""
    # No message reports a missing feature, because the extension was removed on purpose.
    assert "left out" not in server.output


def test_stop_stops_until_it_is_cleared(server: AppServer, arm: Client) -> None:
    arm.joints(THERE)
    arm.ask(requests.Joints(q=FAR))
    wait(arm, lambda state: state.moving)
    assert ask(f"{server.url}{ROOT}/stop", data=b"", X_Program="a-test-that-posts")[0] == 204
    state = wait(arm, lambda state: state.stop == "confirmed" and not state.moving)
    assert abs(state.q[0] - FAR[0]) > 0.1
    with pytest.raises(RefusedError, match="clear the stop"):
        arm.ask(requests.Joints(q=THERE))
    arm.clear_stop()
    assert arm.joints(THERE).why == ""


def test_arm_stops_when_its_driver_leaves(server: AppServer) -> None:
    with connect(server.url, "Watcher") as watcher:
        with connect(server.url, "Leaver") as leaver:
            leaver.joints(THERE)
            leaver.ask(requests.Joints(q=FAR))
            wait(watcher, lambda state: state.moving)
        state = wait(watcher, lambda state: state.stopped is not None and not state.moving)
        assert state.stopped == "Leaver left while the arm moved."
        assert state.holder is None
        watcher.clear_stop()


@pytest.mark.parametrize("request_", [Program(text="steps: []"), Steer(order=ProgramOrder.RUN)])
def test_request_of_the_missing_extension_is_refused_by_name(
    arm: Client, request_: requests.Request
) -> None:
    name = type(request_).__name__.lower()
    holder = arm.joints(THERE).holder
    assert holder is not None
    with pytest.raises(RefusedError, match=f"This server has no request '{name}'"):
        arm.ask(request_)
    # The connection stays open, and the lease is kept.
    assert arm.joints(THERE).holder == holder


def test_openapi_lists_only_available_requests(server: AppServer) -> None:
    shapes = json.loads(ask(f"{server.url}{ROOT}/openapi.json")[2])["components"]["schemas"]
    assert "Joints" in shapes
    assert not {"Program", "Steer", "Order"} & set(shapes)


def test_page_and_its_files_are_served(server: AppServer) -> None:
    assert ask(f"{server.url}/health")[::2] == (200, b"ok\n")
    for path in ("/", "/static/page.js", "/static/link.js"):
        status, _, body = ask(server.url + path)
        assert status == 200, path
        assert body
    # Uploads belong to another extension, which needs the missing one.
    upload = ask(
        f"{server.url}{ROOT}/mesh?name=a.stl", data=b"solid", X_Program="a-test-that-posts"
    )
    assert upload[0] == 404


@pytest.mark.parametrize("option", ["--programs", "--owner-silence", "--scene"])
def test_option_of_the_missing_extension_is_refused(option: str, tmp_path: Path) -> None:
    with without(tmp_path, "programs"):
        done = subprocess.run(
            [sys.executable, "-m", "katana450", "serve", option, "1"],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert f"unrecognized arguments: {option}" in done.stderr


@pytest.mark.long
def test_another_distribution_provides_the_runner(tmp_path: Path) -> None:
    """Its request, progress and folder are available, and its errors do not block a stop."""
    distribution(tmp_path, "station:EXTENSION", STATION)
    with (
        without(tmp_path, "programs"),
        AppServer(STRICT_APP) as server,
        connect(server.url, "Watcher") as watcher,
    ):
        start = watcher.query(answers.State)
        assert start.program is None
        assert post(server, do="nod")[1]["is"] == "refused"
        status, done = post(server, do="nod", by=0.01)
        assert (status, done["outcome"]) == (200, "accepted")
        goal = start.goal[3] + 0.01
        state = wait(watcher, lambda state: abs(state.q[3] - goal) < 1e-6)
        assert state.program is not None
        assert state.program.name == "nods"
        watcher.ask(requests.Stop())
        state = wait(watcher, lambda state: state.stop == "confirmed")
        assert state.stopped == "Watcher pressed STOP."
        for name in ("stopped", "redirected"):
            assert f"a fault in {name}" in server.output
