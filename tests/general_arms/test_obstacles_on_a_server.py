"""Arms with four, six and seven axes keep clear of table and objects, however they are driven."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.arm.control.session import Session
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.assembly.robot_session import find_robot
from katana450.client import Client, connect
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from katana450.settings import Settings
from tests.browser.server import APP, AppServer
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.published_arms import OPENMANIPULATOR_X, PANDA, UR5E

pytestmark = pytest.mark.long

ARMS = {"OpenMANIPULATOR-X": OPENMANIPULATOR_X, "UR5e": UR5E, "Panda": PANDA}

STOP = 0.005
"""[m] Distance that every part keeps."""

FREE = 0.03
"""[m] Distance of the wall from the arm at Home, at least."""

SECONDS = 90.0


@pytest.fixture(scope="module", params=ARMS)
def chain(request: pytest.FixtureRequest) -> Chain:
    return ARMS[request.param]


@pytest.fixture(scope="module")
def path(chain: Chain, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(chain_urdf("arm", chain), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def session(path: Path) -> Session:
    """Return the session of the arm, which measures distances."""
    return find_robot(Settings(), path, None).session


@pytest.fixture(scope="module")
def server(path: Path) -> Iterator[AppServer]:
    with AppServer((*APP, "--urdf", str(path))) as server:
        yield server


@pytest.fixture(scope="module")
def wall(session: Session) -> SceneObject:
    """Return a wall to the left or right of the arm at Home, as high as its tool."""
    model = session.require_arm()
    assert isinstance(model, MountedArm)
    x, y, z = (model.T_base_shoulder @ forward(model.chain, session.ready))[:3, 3].tolist()
    for away in (0.09, -0.09, 0.14, -0.14):
        T = se3.from_rotation_translation(np.eye(3), (x, y + away, 0.0))
        wall = SceneObject("wall", Shape.BOX, (0.24, 0.02, z + 0.03), T)
        if gap(session, wall, session.ready) > FREE:
            return wall
    raise AssertionError


def side(arm: Client, wall: SceneObject) -> float:
    """Return 1 for a wall on the left of the tool, -1 for one on its right."""
    return float(np.sign(wall.T[1, 3] - at(arm)[1]))


@pytest.fixture
def arm(server: AppServer, wall: SceneObject) -> Iterator[Client]:
    """Return an arm at Home beside the wall."""
    with connect(server.url) as client:
        client.clear_stop()
        if any(each.name == "wall" for each in client.query(answers.Objects).objects):
            client.ask(requests.Remove(name="wall"))
        client.ask(requests.Home(wait=60))
        T: Any = tuple(map(tuple, wall.T.tolist()))
        size = list(wall.size)
        client.ask(requests.Place(name="wall", shape=requests.Shape.BOX, size=size, T=T))
        yield client
        client.clear_stop()


def base(arm: Client) -> FloatArray:
    return np.array(arm.query(answers.Arm).T_base_shoulder)


def at(arm: Client) -> FloatArray:
    """Return the tool point (3,) in the base frame [m]."""
    found: FloatArray = (base(arm) @ np.array(arm.query(answers.State).T))[:3, 3]
    return found


def in_shoulder(arm: Client, p: FloatArray) -> tuple[float, float, float]:
    x, y, z = (base(arm)[:3, :3].T @ (p - base(arm)[:3, 3])).tolist()
    return x, y, z


def gap(session: Session, wall: SceneObject, q: Sequence[float] | FloatArray) -> float:
    """Return the distance of the arm from the wall at `q` (n,) [m]; the arm has no hand."""
    world = session.environment.world((wall,))
    assert world is not None
    x = np.append(q, 0.0)
    return min(world.gap(x, part.name, "wall") for part in world.parts)


def meets_wall(answer: object) -> None:
    assert isinstance(answer, answers.Done)
    assert answer.end is not None
    assert answer.end.how == "contact", answer.end
    assert "wall are" in answer.end.why


def test_drag_stops_before_the_wall(arm: Client, session: Session, wall: SceneObject) -> None:
    start = at(arm)
    goal = in_shoulder(arm, start + np.array((0.0, 0.25 * side(arm, wall), 0.0)))
    meets_wall(arm.ask(requests.Position(p=goal, wait=60)))
    assert 0.0 < (at(arm)[1] - start[1]) / (wall.T[1, 3] - start[1]) < 1.0
    assert gap(session, wall, arm.query(answers.State).q) > STOP - 1e-6


def test_slider_stops_before_the_wall(arm: Client, session: Session, wall: SceneObject) -> None:
    q = arm.query(answers.State).q
    meets_wall(arm.ask(requests.Joint(axis=1, value=q[0] + 1.6 * side(arm, wall), wait=60)))
    assert gap(session, wall, arm.query(answers.State).q) > STOP - 1e-6


def test_jog_stops_before_the_wall_and_leaves_it(
    arm: Client, session: Session, wall: SceneObject
) -> None:
    start, seen, why, towards = at(arm)[1], [], "", side(arm, wall)
    end = time.monotonic() + SECONDS
    while "wall are" not in why and time.monotonic() < end:
        arm.ask(requests.Jog(rates=(0.0, 0.08 * towards, 0.0, 0.0, 0.0, 0.0)))
        time.sleep(0.05)
        now = arm.query(answers.State)
        seen.append(gap(session, wall, now.q))
        why = now.why
    assert "wall are" in why
    assert min(seen) > STOP - 1e-6
    there = at(arm)[1]
    assert 0.0 < (there - start) / (wall.T[1, 3] - start) < 1.0
    while towards * (there - at(arm)[1]) < 0.02 and time.monotonic() < end:
        arm.ask(requests.Jog(rates=(0.0, -0.08 * towards, 0.0, 0.0, 0.0, 0.0)))
        time.sleep(0.05)
    assert towards * (there - at(arm)[1]) >= 0.02


def status(arm: Client) -> answers.State:
    """Return the state once the script is neither planned nor runs."""
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        now = arm.query(answers.State)
        if now.program is not None and now.program.status not in ("planning", "running"):
            return now
        time.sleep(0.05)
    raise AssertionError(arm.query(answers.State).program)


def test_line_of_a_script_through_the_wall_is_refused(arm: Client, wall: SceneObject) -> None:
    steps = f"  - line: {{by: {{y: {250.0 * side(arm, wall)}}}}}\n"
    arm.ask(Program(text=f"name: Through\nframe: base\nsteps:\n{steps}"))
    found = status(arm).program
    assert found is not None
    assert found.status == "refused"
    assert "wall" in found.why


def test_joints_of_a_script_are_planned_round_the_wall(
    arm: Client, session: Session, wall: SceneObject
) -> None:
    q = arm.query(answers.State).q
    pan = q[0] + 1.6 * side(arm, wall)
    goal = np.degrees([pan, *q[1:]]).round(6).tolist()
    arm.ask(Program(text=f"name: Round\nsteps:\n  - move: {{joints: {goal}}}\n"))
    now = status(arm)
    assert now.program is not None
    assert now.program.status == "ready", now.program.why
    arm.ask(Steer(order=ProgramOrder.RUN))
    seen = []
    for now in arm.states(20.0):
        seen.append(gap(session, wall, now.q))
        if now.program is not None and now.program.status in ("done", "failed", "stopped"):
            break
    assert now.program is not None
    assert now.program.status == "done"
    assert abs(now.q[0] - pan) < 1e-6
    assert min(seen) > STOP - 1e-6


def test_slider_stops_before_the_table(arm: Client) -> None:
    arm.ask(requests.Remove(name="wall"))
    described, why = arm.query(answers.Arm), []
    for end in (described.lower[1], described.upper[1]):
        arm.ask(requests.Home(wait=60))
        answer = arm.ask(requests.Joint(axis=2, value=end, wait=60))
        assert isinstance(answer, answers.Done)
        assert answer.end is not None
        why.append(answer.end.why)
    assert any("and table are" in each for each in why), why
