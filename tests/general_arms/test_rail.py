"""Arms on a rail and on a lift: their tool is driven, with the axis that slides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.findings import margins
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.state import Reason, State, Status
from katana450.assembly.robot_session import find_robot
from katana450.errors import RobotDescriptionError
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.forward import forward, jacobian_body
from katana450.settings import Settings
from tests.general_arms.driven import pose, run, settled
from tests.general_arms.links_of_arms import ur5e
from tests.robot.public_arms import J, urdf

RAIL = (
    '<link name="rail"/><joint name="slide" type="prismatic"><parent link="rail"/>'
    '<child link="base_link"/><axis xyz="1 0 0"/>'
    '<limit lower="-1" upper="4" velocity="0.5" effort="10"/></joint><link name="base_link">'
)

LIFT = [
    J("lift", "prismatic", "base", "carriage", limits=(0.0, 0.5), speed=0.3),
    J("one", "revolute", "carriage", "inner", (0.1, 0.0, 0.0)),
    J("two", "revolute", "inner", "outer", (0.3, 0.0, 0.0)),
    J("three", "revolute", "outer", "wrist", (0.25, 0.0, 0.0), limits=(-3.0, 3.0)),
    J("flange", "fixed", "wrist", "tool0", (0.0, 0.0, -0.1)),
]
"""A SCARA arm with a lift at its base."""

ARMS = {"rail": ur5e().replace('<link name="base_link">', RAIL, 1), "lift": urdf("lift", LIFT)}


def session_of(name: str, folder: Path) -> Session:
    path = folder / "arm.urdf"
    path.write_text(ARMS[name], encoding="utf-8")
    return find_robot(Settings(), path, None).session


def moved(
    session: Session, state: State, commands: Sequence[cmd.Command]
) -> tuple[State, FloatArray]:
    """Return the state at rest after ``commands``, and the pose of its tool."""
    after = settled(session, state, commands)
    return after, pose(session, after)


@pytest.mark.parametrize("name", ARMS)
def test_kinematics_count_the_length_of_the_axis_that_slides(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARMS[name], encoding="utf-8")
    arm = katana450.load(path)
    chain, rng = arm.chain, np.random.default_rng(1)
    assert chain.slides == (True, *(False,) * (chain.n - 1))
    for q in rng.uniform(chain.lower, chain.upper, (8, chain.n)):
        T = forward(chain, q)
        np.testing.assert_allclose(forward_batch(chain, q[None])[0], T, atol=1e-14)
        moved = [forward(chain, q + 1e-6 * axis) for axis in np.eye(chain.n)]
        columns = [se3.log(se3.inverse(T) @ other) / 1e-6 for other in moved]
        np.testing.assert_allclose(jacobian_body(chain, q), np.column_stack(columns), atol=1e-8)
        (solution,) = arm.ik(T)
        assert solution.exact
        assert solution.within_limits
        np.testing.assert_allclose(forward(chain, solution.q), T, atol=1e-9)
        by = np.zeros(chain.n)
        by[0] = 0.1
        axis = np.array((1.0, 0.0, 0.0) if name == "rail" else (0.0, 0.0, 1.0))
        np.testing.assert_allclose(forward(chain, q + by)[:3, 3], T[:3, 3] + 0.1 * axis, atol=1e-12)
        assert math.dist(T[:3, 3], (0.0, 0.0, 0.0)) <= chain.reach


@pytest.mark.parametrize("name", ARMS)
def test_tool_is_dragged_stepped_and_jogged_along_its_line(name: str, tmp_path: Path) -> None:
    session = session_of(name, tmp_path)
    start = session.begin(session.ready, 0.0, 0.0)
    T = pose(session, start)
    by = np.array((0.03, 0.02, 0.05))
    state, reached = moved(session, start, [cmd.Position(T[:3, 3] + by)])
    assert state.status is Status.OK
    np.testing.assert_allclose(reached[:3, 3], T[:3, 3] + by, atol=1e-7)
    np.testing.assert_allclose(reached[:3, :3], T[:3, :3], atol=1e-6)
    step = np.array((0.0, 0.0, 0.02, 0.0, 0.0, 0.1))
    _, stepped = moved(session, state, [cmd.StepTool(step)])
    np.testing.assert_allclose(stepped[:3, 3], reached[:3, 3] + step[:3], atol=1e-7)
    np.testing.assert_allclose(stepped[:3, :3], so3.rotation_z(0.1) @ T[:3, :3], atol=1e-6)
    jog = cmd.Jog(np.array((0.0, 0.0, -0.05, 0.0, 0.0, 0.0)))
    for _ in range(60):
        state = run(session, state, [jog])
    jogged = pose(session, state)
    np.testing.assert_allclose(jogged[:2, 3], reached[:2, 3], atol=1e-4)
    assert reached[2, 3] - jogged[2, 3] > 0.005


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["lift", "rail"])
def test_limit_of_the_axis_that_slides_is_a_length(name: str, tmp_path: Path) -> None:
    session = session_of(name, tmp_path)
    start = session.begin(session.ready, 0.0, 0.0)
    state = settled(session, start, [cmd.Nudge(1, 9.0)])
    assert state.findings[0].reason is Reason.SLIDE_LIMIT
    end = {"rail": "4000.0 mm", "lift": "500.0 mm"}[name]
    assert sentence(state) == f"Axis 1 at its limit of {end}."
    # Its distance from there is no angle.
    x = np.append(state.q, 0.0)
    assert margins(session.require_arm().chain, None, x).axis > 0


def test_only_the_first_axis_may_slide(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    axes = [*LIFT[:2], LIFT[2]._replace(type="prismatic"), *LIFT[3:]]
    path.write_text(urdf("lift", axes), encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match="after one rail or lift at most"):
        katana450.load(path)


def test_script_moves_the_tool_and_gives_no_lengths_as_angles(tmp_path: Path) -> None:
    session = session_of("rail", tmp_path)
    context, start = PlanContext(session, np.eye(4)), session.begin(session.ready, 0.0, 0.0)
    text = "steps:\n  - line: {by: {x: 20, y: 10, z: 10}}\n  - home\n"
    program = compiled(parse(text), context, start)
    ends = [task.action.plan.end for task in program.tasks if isinstance(task.action, FollowPlan)]
    places = forward_batch(session.require_arm().chain, np.array([start.q, *ends]))[:, :3, 3]
    np.testing.assert_allclose(places[1] - places[0], (0.02, 0.01, 0.01), atol=1e-9)
    np.testing.assert_allclose(ends[-1], start.q, atol=1e-9)
    with pytest.raises(ScriptError, match=r"axis 1, .*, over its limit of -1000.0 mm .* %"):
        compiled(parse("steps:\n  - line: {by: {x: -1900}}\n"), context, start)
    for step in ("joints: [0, 0, -90, -135, 45, -90, 0]", "nudge: {axis: 1, by: 5}"):
        with pytest.raises(ScriptError, match="Axis 1 slides"):
            compiled(parse(f"steps:\n  - {step}\n"), context, start)


def test_continuous_wrist_keeps_the_closed_form(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    name = '<joint name="wrist_3_joint" type='
    path.write_text(ur5e().replace(f'{name}"revolute"', f'{name}"continuous"'), encoding="utf-8")
    arm = katana450.load(path)
    assert "closed form" in arm.method
    q = arm.ready + 0.1
    solutions = list(arm.ik(arm.fk(q)))
    assert len(solutions) == 8
    assert min(float(np.abs(solution.q - q).max()) for solution in solutions) < 1e-9
