"""Arms of other kinds behind a server: their tools are driven, walls met, and scripts run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.robot.arm_reader import MountedArm
from katana450.assembly.robot_session import find_robot
from katana450.client import Client
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from katana450.settings import Settings
from tests.gateway.virtual import VirtualServer
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.links_of_arms import ur5e
from tests.general_arms.published_arms import OPENMANIPULATOR_X, PANDA, UR5E

STOP = 0.005
"""[m] Distance that every part keeps from a wall."""

FREE = 0.03
"""[m] Minimum distance of the wall from the arm at Home."""

SECONDS = 120.0


@contextmanager
def served(folder: Path, text: str) -> Iterator[tuple[Client, Session]]:
    """Serve the arm of a description; return a program with the lease, and the arm's session."""
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    described = find_robot(Settings(), path, None)
    with VirtualServer(described) as server, server.connect() as arm:
        arm.ask(requests.Acquire())
        yield arm, described.session


def state(arm: Client) -> answers.State:
    return arm.query(answers.State)


def pose(arm: Client) -> FloatArray:
    return np.array(state(arm).T)


def until(arm: Client, holds: Callable[[answers.State], bool]) -> answers.State:
    """Return the first state for which ``holds`` is true."""
    end = time.monotonic() + SECONDS
    for now in arm.states(100.0):
        if holds(now):
            return now
        if time.monotonic() > end:
            break
    raise AssertionError(state(arm).program)


def status(now: answers.State) -> str:
    return "" if now.program is None else now.program.status


def planned(arm: Client, text: str) -> answers.Progress:
    """Send a script, and return how its planning ended."""
    arm.ask(Program(text=text))
    program = until(arm, lambda now: status(now) not in ("", "planning")).program
    assert program is not None
    return program


def started(arm: Client, text: str) -> None:
    program = planned(arm, text)
    assert program.status == "ready", program.why
    arm.ask(Steer(order=ProgramOrder.RUN))


def test_tool_is_moved_turned_and_stepped_and_undone(tmp_path: Path) -> None:
    with served(tmp_path, ur5e()) as (arm, _):
        T = pose(arm)
        T[:3, 3] += (0.05, 0.05, -0.05)
        arm.ask(requests.Position(p=T[:3, 3], wait=30))
        np.testing.assert_allclose(pose(arm), T, atol=1e-6)
        T[:3, :3] = so3.exp([0.1, 0.2, -0.1]) @ T[:3, :3]
        arm.ask(requests.Orient(R=T[:3, :3], wait=30))
        np.testing.assert_allclose(pose(arm), T, atol=1e-6)
        T[:3, 3] += (0.0, -0.1, 0.05)
        arm.ask(requests.Pose(T=T, wait=30))
        np.testing.assert_allclose(pose(arm), T, atol=1e-6)
        arm.ask(requests.StepTool(by=np.array((0.0, 0.03, 0.0, 0.0, 0.0, 0.1)), wait=30))
        np.testing.assert_allclose(pose(arm)[:3, 3], T[:3, 3] + (0, 0.03, 0), atol=1e-6)
        np.testing.assert_allclose(pose(arm)[:3, :3], so3.rotation_z(0.1) @ T[:3, :3], atol=1e-6)
        arm.ask(requests.Undo(wait=30))
        np.testing.assert_allclose(pose(arm), T, atol=1e-6)


def wall_beside(session: Session) -> tuple[SceneObject, float]:
    """Return a wall to the left (1) or right (-1) of the arm at Home, and that side."""
    model = session.require_arm()
    assert isinstance(model, MountedArm)
    x, y, z = (model.T_base_shoulder @ forward(model.chain, session.ready))[:3, 3].tolist()
    for away in (0.09, -0.09, 0.14, -0.14):
        T = se3.from_rotation_translation(np.eye(3), (x, y + away, 0.0))
        wall = SceneObject("wall", Shape.BOX, (0.24, 0.02, z + 0.03), T)
        if gap(session, wall, session.ready) > FREE:
            return wall, float(np.sign(away))
    raise AssertionError


def gap(session: Session, wall: SceneObject, q: Any) -> float:
    """Return the distance of the arm from the wall at `q` (n,) [m]; the arm has no hand."""
    world = session.environment.world((wall,))
    assert world is not None
    x = np.append(q, 0.0)
    return min(world.gap(x, part.name, "wall") for part in world.parts)


@pytest.mark.cases(1)
@pytest.mark.parametrize("chain", [UR5E, OPENMANIPULATOR_X, PANDA], ids=["UR5e", "OpenX", "Panda"])
def test_drag_slider_jog_and_script_keep_clear_of_a_wall(chain: Chain, tmp_path: Path) -> None:
    with served(tmp_path, chain_urdf("arm", chain)) as (arm, session):
        wall, side = wall_beside(session)
        size = list(wall.size)
        arm.ask(requests.Place(name="wall", shape=requests.Shape.BOX, size=size, T=wall.T))
        R_base = np.array(arm.query(answers.Arm).T_base_shoulder)[:3, :3]
        goal = pose(arm)[:3, 3] + R_base.T @ (0.0, 0.25 * side, 0.0)
        pan = state(arm).q[0] + 1.6 * side
        for request in (
            requests.Position(p=goal, wait=60),
            requests.Joint(axis=1, value=pan, wait=60),
        ):
            arm.ask(requests.Home(wait=60))
            done = arm.ask(request)
            assert isinstance(done, answers.Done)
            assert done.end is not None
            assert (done.end.how, "wall are" in done.end.why) == ("contact", True)
            assert STOP - 1e-6 < gap(session, wall, state(arm).q) < FREE
        arm.ask(requests.Home(wait=60))
        end = time.monotonic() + SECONDS
        while "wall are" not in state(arm).why and time.monotonic() < end:
            arm.ask(requests.Jog(rates=np.array((0.0, 0.08 * side, 0.0, 0.0, 0.0, 0.0))))
            time.sleep(0.05)
            assert gap(session, wall, state(arm).q) > STOP - 1e-6
        assert "wall are" in state(arm).why
        arm.ask(requests.Home(wait=60))
        refused = planned(arm, f"frame: base\nsteps:\n  - line: {{by: {{y: {250.0 * side}}}}}\n")
        assert refused.status == "refused"
        assert "wall" in refused.why
        joints = np.degrees([pan, *state(arm).q[1:]]).round(6).tolist()
        started(arm, f"steps:\n  - move: {{joints: {joints}}}\n")
        for now in arm.states(20.0):
            assert gap(session, wall, now.q) > STOP - 1e-6
            if status(now) in ("done", "failed", "stopped"):
                break
        assert status(now) == "done"
        assert abs(now.q[0] - pan) < 1e-6
