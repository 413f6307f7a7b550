"""A box is picked and placed on the real server of a Panda, with its recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.client import Client, connect
from katana450.extensions.programs.requests import Program, ProgramOrder, Steer
from katana450.maths.geometry import so3
from katana450.server.api import answers, requests
from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.general_arms.gripping_arms import gripping_urdf

pytestmark = pytest.mark.long

SECONDS = 120.0
AT, TO = (0.5, 0.1), (0.4, -0.2)
"""[m] Places of the box on the table."""


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "panda.urdf"
    path.write_text(gripping_urdf("Panda"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def server(urdf: Path) -> Iterator[AppServer]:
    app = (*ATTENTIVE_APP, "--silence", "2.0", "--owner-silence", "6.0", "--urdf", str(urdf))
    with AppServer(app) as server:
        yield server


@pytest.fixture
def arm(server: AppServer) -> Iterator[Client]:
    """Return the arm at Home with the box in front of it."""
    with connect(server.url) as client:
        client.clear_stop()
        client.ask(requests.Home(wait=60))
        for each in client.query(answers.Objects).objects:
            client.ask(requests.Remove(name=each.name))
        T = np.eye(4)
        T[:3, :3] = so3.rotation_z(0.3)
        T[:2, 3] = AT
        rows: Any = tuple(map(tuple, T.tolist()))
        client.ask(
            requests.Place(
                name="box",
                shape=requests.Shape.BOX,
                size=[0.04, 0.05, 0.06],
                T=rows,
                can_be_held=True,
            )
        )
        yield client
        client.clear_stop()


def until(arm: Client, holds: Callable[[answers.State], bool]) -> answers.State:
    """Return the first state for which ``holds`` is true."""
    end = time.monotonic() + SECONDS
    for now in arm.states(100.0):
        if holds(now):
            return now
        if time.monotonic() > end:
            break
    raise AssertionError(arm.query(answers.State).program)


def status(now: answers.State) -> str:
    return "" if now.program is None else now.program.status


def started(arm: Client, *steps: str) -> None:
    text = "frame: base\nsteps:\n" + "".join(f"  - {each}\n" for each in steps)
    arm.ask(Program(text=text))
    planned = until(arm, lambda now: status(now) not in ("", "planning"))
    assert planned.program is not None
    assert planned.program.status == "ready", planned.program.why
    arm.ask(Steer(order=ProgramOrder.RUN))


def box(arm: Client) -> answers.SceneObject:
    (found,) = arm.query(answers.Objects).objects
    return found


def test_box_is_picked_and_placed(arm: Client) -> None:
    started(arm, "pick: box", "place: {at: {x: 400, y: -200, yaw: 40}}", "home")
    until(arm, lambda now: now.held == "box")
    end = until(arm, lambda now: status(now) in ("done", "failed", "stopped"))
    assert status(end) == "done", end.program
    assert end.held is None
    T = np.array(box(arm).T)
    np.testing.assert_allclose(T[:3, 3], (*TO, 0.0), atol=1e-9)
    assert np.degrees(np.arctan2(T[1, 0], T[0, 0])) % 180.0 == pytest.approx(40.0, abs=1e-6)


def test_stop_keeps_the_box_in_the_hand_and_the_program_continues(arm: Client) -> None:
    started(arm, "pick: box", "place: {at: {x: 400, y: -200}}", "home")
    until(arm, lambda now: now.held == "box" and now.program is not None and now.program.step == 2)
    arm.stop()
    stopped = until(arm, lambda now: bool(now.stopped) and not now.moving)
    assert stopped.held == "box"
    until(arm, lambda now: status(now) == "stopped")
    arm.clear_stop()
    arm.ask(Steer(order=ProgramOrder.CONTINUE))
    end = until(arm, lambda now: status(now) in ("done", "failed"))
    assert status(end) == "done", end.program
    np.testing.assert_allclose(np.array(box(arm).T)[:3, 3], (*TO, 0.0), atol=1e-9)
