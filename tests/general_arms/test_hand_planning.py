"""The planning of hands of all arms: the plane of fewer than six axes, and the way round axis 1."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.planning.hand_frames import ArmPlane, GraspFrame
from katana450.extensions.programs.planning.hand_planning import HandPlanning
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from tests.general_arms.driven import begun, session_of
from tests.general_arms.programs import begin_plan
from tests.general_arms.published_arms import OPENMANIPULATOR_X, PANDA, UR5E


def hand(chain: Chain) -> HandPlanning:
    """Return the hand of an arm whose tool frame is its grasp frame."""
    plan_state: PlanState = begin_plan(chain)
    return HandPlanning(plan_state.planning, np.eye(4), np.eye(4), GraspFrame(np.eye(4), 0.1), None)


@pytest.mark.parametrize(("chain", "turn"), [(UR5E, 6.0 - math.tau), (PANDA, 6.0)])
def test_object_is_not_carried_behind_an_axis_that_does_not_turn_all_round(
    chain: Chain, turn: float
) -> None:
    assert hand(chain).way_round(-3.0, 3.0) == pytest.approx(turn, abs=1e-12)


def test_plane_of_the_arm_gives_the_tool_at_every_posture() -> None:
    chain = OPENMANIPULATOR_X
    # {S} is on axis 1.
    T = se3.from_rotation_translation(np.eye(3), -screws.point_on(chain.S[:, 0]))
    chain = replace(chain, M=T @ chain.M, S=se3.adjoint(T) @ chain.S)
    q = begun(session_of(chain)).q
    # The fingers point along the links, and close across them.
    T_tool_grasp = se3.from_rotation_translation(
        forward(chain, np.zeros(4))[:3, :3].T, np.array((0.02, 0.0, 0.0))
    )
    plane = ArmPlane.of(chain, T_tool_grasp, q)
    turned = q + np.array((0.7, 0.1, -0.2, 0.3))
    T = forward(chain, turned)
    R = so3.rotation_z(-plane.sign * turned[0]) @ T[:3, :3]
    pitch, roll = plane.angles(R)
    np.testing.assert_allclose(plane.rotation(pitch, roll), R, atol=1e-12)
    grasp = (T @ T_tool_grasp)[:3, 3]
    offset = plane.beside_at(R, T_tool_grasp[:3, 3])
    assert plane.turn(grasp, offset) == pytest.approx(plane.sign * turned[0], abs=1e-12)
