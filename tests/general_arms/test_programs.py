"""Scripts for arms outside the five-axis family: what they can have, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.errors import InputError
from katana450.extensions.programs.moves import Home, Joints, Move, Nudge, Via
from katana450.extensions.programs.plan_builder import PlanBuilder, PlanContext
from katana450.extensions.programs.step_target import StepTarget
from katana450.maths.geometry import so3
from katana450.maths.kinematics.chain import Chain
from tests.general_arms.driven import begun, pose, session_of, settled
from tests.general_arms.published_arms import OPENMANIPULATOR_X, PANDA, UR5E

ARMS = pytest.mark.parametrize(
    "chain", [UR5E, PANDA, OPENMANIPULATOR_X], ids=["UR5e", "Panda", "OpenMANIPULATOR-X"]
)


def builder(chain: Chain) -> PlanBuilder:
    session = session_of(chain)
    return PlanBuilder(PlanContext(session, np.eye(4)), begun(session))


@ARMS
def test_move_to_a_point_keeps_the_orientation_and_is_followed(chain: Chain) -> None:
    made = builder(chain)
    session = made.plan_context.session
    start = made.state
    T = pose(session, start)
    point = T[:3, 3] + (0.0, 0.02, -0.02)
    Move(StepTarget(position=point)).build(made)
    _, untimed = made.actions[-1]
    plan = untimed.timed().plan  # type: ignore[union-attr]
    reached = pose(session, settled(session, start, [cmd.Follow(plan)]))
    np.testing.assert_allclose(reached[:3, 3], point, atol=1e-6)
    if chain.n >= 6:
        assert so3.angle(reached[:3, :3], T[:3, :3]) < 1e-6


@ARMS
def test_joints_nudge_via_and_home_are_planned(chain: Chain) -> None:
    made = builder(chain)
    q = np.array(made.q)
    turned = q + 0.1
    Joints(turned).build(made)
    np.testing.assert_allclose(made.q, turned, atol=1e-9)
    Nudge(0, -0.2).build(made)
    assert made.q[0] == pytest.approx(turned[0] - 0.2)
    Via((StepTarget(joints=q + 0.05), StepTarget(joints=q - 0.05)), 0.5).build(made)
    np.testing.assert_allclose(made.q, q - 0.05, atol=1e-9)
    Home().build(made)
    np.testing.assert_allclose(made.q, q, atol=1e-9)


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (Move(StepTarget(position=np.array([0.4, 0.1, 0.3]), pitch=0.1)), "five-axis arm"),
        (Move(StepTarget(position=np.array([4.0, 0.1, 0.3]))), "mm out of reach"),
        (Joints(np.zeros(5)), "has 6 joints, but the command has 5"),
        (Nudge(6, 0.1), "6"),
    ],
)
def test_what_needs_five_axes_is_refused(step: Move | Joints | Nudge, message: str) -> None:
    with pytest.raises(InputError, match=message):
        step.build(builder(UR5E))


def test_path_of_the_tool_is_refused_with_what_works() -> None:
    made = builder(UR5E)
    with pytest.raises(InputError, match="`joints`, `nudge`, `move`"):
        made.lead([], "line")
