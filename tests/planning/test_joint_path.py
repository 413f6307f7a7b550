"""Joint paths: straight legs, smooth corners, nothing outside the vias."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.arm import ArmModel
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.path import joint_derivatives, point_derivatives


def random_vias(arm: ArmModel, seed: int) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    vias = rng.uniform(arm.chain.lower, arm.chain.upper, (count, 5))
    return vias, rng.uniform(0.05, 1.0, count - 2)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_corners_join_their_legs_smoothly_and_stay_inside(arm: ArmModel, seed: int) -> None:
    vias, blend = random_vias(arm, seed)
    path = JointPath(arm.chain, vias, blend)
    assert (path.start == vias[0]).all()
    assert (path.end == vias[-1]).all()
    ends = joint_derivatives(path, np.array([0.0, 1.0]))[0]
    assert ends == pytest.approx(vias[[0, -1]], abs=1e-13)
    joins = np.array(path.joins)
    before, after = (joint_derivatives(path, joins + step) for step in (-1e-9, 1e-9))
    for order in range(3):
        scale = np.abs(after[order + 1]).max(initial=1.0)
        assert after[order] == pytest.approx(before[order], abs=1e-8 * scale)
    q = joint_derivatives(path, np.linspace(0.0, 1.0, 400))[0]
    assert (q >= vias.min(axis=0) - 1e-12).all()
    assert (q <= vias.max(axis=0) + 1e-12).all()


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_the_tool_point_is_that_of_forward_kinematics(arm: ArmModel, seed: int) -> None:
    path = JointPath(arm.chain, *random_vias(arm, seed))
    sigma = np.linspace(0.0, 1.0, 9)
    q, p = joint_derivatives(path, sigma)[0], point_derivatives(path, sigma)[0]
    for angles, point in zip(q, p, strict=True):
        assert point == pytest.approx(forward(arm.chain, angles)[:3, 3], abs=1e-14)


def test_a_leg_alone_is_straight(arm: ArmModel) -> None:
    vias = np.array([[0.0, -1.0, 1.0, 0.0, 0.0], [1.0, -0.5, 0.5, 0.3, 0.0]])
    path = JointPath(arm.chain, vias)
    for sigma in (0.0, 0.3, 1.0):
        q = np.array([joint.c0 for joint in path.joints(Jet.variable(sigma))])
        assert q == pytest.approx(vias[0] + sigma * (vias[1] - vias[0]), abs=1e-15)


def test_a_smaller_blend_passes_its_via_nearer(arm: ArmModel) -> None:
    vias, _ = random_vias(arm, 3)
    sigma = np.linspace(0.0, 1.0, 2000)
    away = []
    for blend in (1.0, 0.5, 0.1):
        path = JointPath(arm.chain, vias, np.full(len(vias) - 2, blend))
        q = joint_derivatives(path, sigma)[0]
        away.append(max(np.linalg.norm(q - via, axis=1).min() for via in vias[1:-1]))
    for more, less in pairwise(away):
        assert less < more


def test_invalid_vias_are_refused(arm: ArmModel, ready: FloatArray) -> None:
    goal = ready + 0.1
    none = np.empty(0)
    for vias, blend in (
        (np.array([ready]), none),
        (np.array([ready, ready]), none),
        (np.array([ready, goal, goal]), np.ones(1)),
        (np.array([ready, goal, ready]), none),
        (np.array([ready, goal, ready]), np.zeros(1)),
        (np.array([ready, goal, ready]), np.array([1.1])),
        (np.array([ready, goal * np.nan]), none),
        (np.array([ready[:4], goal[:4]]), none),
    ):
        with pytest.raises(InputError):
            JointPath(arm.chain, vias, blend)
    with pytest.raises(InputError, match=r"Via 2 has axis 2 at 57.3 deg, 49.55 deg beyond"):
        JointPath(arm.chain, np.array([ready, [0.0, 1.0, 0.0, 0.0, 0.0]]))
