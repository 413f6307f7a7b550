"""A box is picked and placed on real servers of arms with hands of all kinds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from katana450.client import Client, connect
from katana450.maths.geometry import so3
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from tests.browser.server import ATTENTIVE_APP, AppServer
from tests.general_arms.gripping_arms import gripping_urdf
from tests.general_arms.published_hands import ROBOTIQ_2F_85, hand_urdf, so101_urdf

pytestmark = pytest.mark.long

SECONDS = 120.0


class Bench(NamedTuple):
    """An arm, places of a box on its table and its size [m].

    Attributes:
        text: the description of the arm.
        at, to: the places.
        size: of the box.
        yaw: angle to which the hand turns it [deg]; None if it cannot.
        error: maximum error of a place; the file of the SO-101 rounds its angles.
    """

    text: str
    at: tuple[float, float] = (0.5, 0.1)
    to: tuple[float, float] = (0.4, -0.2)
    size: tuple[float, float, float] = (0.04, 0.05, 0.06)
    yaw: float | None = 40.0
    error: float = 1e-9


BENCHES = {
    "Panda": Bench(gripping_urdf("Panda")),
    "Robotiq 2F-85": Bench(hand_urdf("UR5e", ROBOTIQ_2F_85)),
    "SO-101": Bench(so101_urdf(), (0.23, 0.06), (0.18, -0.12), (0.025, 0.02, 0.05), None, 1e-6),
}


@pytest.fixture(scope="module", params=BENCHES)
def bench(request: pytest.FixtureRequest) -> Bench:
    return BENCHES[request.param]


@pytest.fixture(scope="module")
def urdf(bench: Bench, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(bench.text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def server(urdf: Path) -> Iterator[AppServer]:
    app = (*ATTENTIVE_APP, "--silence", "2.0", "--owner-silence", "6.0", "--urdf", str(urdf))
    with AppServer(app) as server:
        yield server


@pytest.fixture
def arm(server: AppServer, bench: Bench) -> Iterator[Client]:
    """Return the arm at Home with the box in front of it."""
    with connect(server.url) as client:
        client.clear_stop()
        client.ask(requests.Home(wait=60))
        for each in client.query(answers.Objects).objects:
            client.ask(requests.Remove(name=each.name))
        T = np.eye(4)
        T[:3, :3] = so3.rotation_z(0.3)
        T[:2, 3] = bench.at
        rows: Any = tuple(map(tuple, T.tolist()))
        client.ask(
            requests.Place(
                name="box",
                shape=requests.Shape.BOX,
                size=list(bench.size),
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


def place(bench: Bench, yaw: str = "") -> str:
    """Return the step that places the box."""
    x, y = (1e3 * each for each in bench.to)
    return f"place: {{at: {{x: {x:g}, y: {y:g}{yaw}}}}}"


def box(arm: Client) -> answers.SceneObject:
    (found,) = arm.query(answers.Objects).objects
    return found


def test_box_is_picked_and_placed(arm: Client, bench: Bench) -> None:
    yaw = "" if bench.yaw is None else f", yaw: {bench.yaw:g}"
    started(arm, "pick: box", place(bench, yaw), "home")
    until(arm, lambda now: now.held == "box")
    end = until(arm, lambda now: status(now) in ("done", "failed", "stopped"))
    assert status(end) == "done", end.program
    assert end.held is None
    T = np.array(box(arm).T)
    np.testing.assert_allclose(T[:3, 3], (*bench.to, 0.0), atol=bench.error)
    if bench.yaw is not None:
        turned = np.degrees(np.arctan2(T[1, 0], T[0, 0])) % 180.0
        assert turned == pytest.approx(bench.yaw, abs=1e-6)


def test_stop_keeps_the_box_in_the_hand_and_the_program_continues(
    arm: Client, bench: Bench
) -> None:
    started(arm, "pick: box", place(bench), "home")
    until(arm, lambda now: now.held == "box" and now.program is not None and now.program.step == 2)
    arm.stop()
    stopped = until(arm, lambda now: bool(now.stopped) and not now.moving)
    assert stopped.held == "box"
    until(arm, lambda now: status(now) == "stopped")
    arm.clear_stop()
    arm.ask(Steer(order=ProgramOrder.CONTINUE))
    end = until(arm, lambda now: status(now) in ("done", "failed"))
    assert status(end) == "done", end.program
    np.testing.assert_allclose(np.array(box(arm).T)[:3, 3], (*bench.to, 0.0), atol=bench.error)
