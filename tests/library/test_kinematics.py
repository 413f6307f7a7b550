"""Kinematics of the library: the same numbers as in the core, in the requested frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import katana450
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.maths.geometry import se3
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.solver import inverse
from tests.exchange.conftest import GANTRY

Q = np.array([0.3, -1.0, 1.4, 0.3, 0.2])


def postures(arm: katana450.Arm, count: int) -> np.ndarray:
    return np.random.default_rng(7).uniform(arm.lower, arm.upper, (count, arm.n))


@pytest.fixture
def mounted(robot: Robot) -> MountedArm:
    return robot.require_arm()


@pytest.fixture(params=["shoulder_arm", "base_arm"])
def arm(request: pytest.FixtureRequest) -> katana450.Arm:
    loaded: katana450.Arm = request.getfixturevalue(request.param)
    return loaded


def test_forward_kinematics_are_those_of_the_core(
    shoulder_arm: katana450.Arm, base_arm: katana450.Arm, mounted: MountedArm
) -> None:
    T = forward(mounted.chain, Q)
    assert (shoulder_arm.fk(Q) == T).all()
    np.testing.assert_allclose(base_arm.fk(Q), mounted.T_base_shoulder @ T, atol=1e-15)
    np.testing.assert_allclose(
        shoulder_arm.T_base_frame @ shoulder_arm.fk(Q), base_arm.fk(Q), atol=1e-15
    )


def test_many_postures_are_the_same_as_one_at_a_time(arm: katana450.Arm) -> None:
    q = postures(arm, 20)
    np.testing.assert_allclose(arm.fk(q), [arm.fk(posture) for posture in q], atol=1e-14)
    solutions = arm.ik(arm.fk(q))
    for number, posture in enumerate(q):
        single = arm.ik(arm.fk(posture))
        np.testing.assert_allclose(solutions.q[number], single.q, atol=1e-7)
        assert (solutions.within_limits[number] == single.within_limits).all()
        assert solutions.position_error[number] == pytest.approx(single.position_error, abs=1e-12)
        assert solutions.rotation_error[number] == pytest.approx(single.rotation_error, abs=1e-9)


def test_all_branches_come_back_with_limits_and_residuals(
    arm: katana450.Arm, mounted: MountedArm
) -> None:
    for q in postures(arm, 20):
        T = arm.fk(q)
        solutions = arm.ik(T)
        assert [candidate.branch for candidate in solutions] == list(solutions.branches)
        for solution, inside in zip(solutions, solutions.within_limits, strict=True):
            assert solution.within_limits == mounted.chain.within_limits(solution.q) == inside
            missed = np.linalg.norm(arm.fk(solution.q)[:3, 3] - T[:3, 3])
            assert missed == pytest.approx(solution.position_error, abs=1e-12)
        assert any(np.abs(candidate.q - q).max() < 1e-6 for candidate in solutions.feasible)


def test_hint_chooses_the_turn(shoulder_arm: katana450.Arm, mounted: MountedArm) -> None:
    T = shoulder_arm.fk(Q)
    hint = Q + 2.0 * np.pi * np.eye(5)[4]
    expected = [solution.q for solution in inverse(mounted.chain, T, q_hint=hint)]
    np.testing.assert_array_equal(shoulder_arm.ik(T, hint).q, expected)


def test_solutions_of_many_poses_are_not_iterated(shoulder_arm: katana450.Arm) -> None:
    solutions = shoulder_arm.ik(shoulder_arm.fk(postures(shoulder_arm, 3)))
    with pytest.raises(katana450.InputError, match="3 poses"):
        list(solutions)


def test_nearest_pose_reports_errors_and_reason(arm: katana450.Arm) -> None:
    T = arm.fk(arm.ready)
    far = T.copy()
    far[0, 3] += 1.0
    best = arm.nearest(far)
    np.testing.assert_allclose(arm.fk(best.q), best.T, atol=1e-14)
    missed = float(np.linalg.norm(best.T[:3, 3] - far[:3, 3]))
    assert best.position_error == pytest.approx(missed, abs=1e-12)
    assert best.reach
    assert "out of reach" in best.reason
    assert "links" in best.reason
    turned = T @ se3.from_rotation_translation(
        np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3)
    )
    assert "yaw" in arm.nearest(turned).reason
    assert arm.nearest(turned, priority="position").position_error < 1e-9


def test_nearest_pose_stays_on_a_branch(arm: katana450.Arm) -> None:
    best = arm.nearest(arm.fk(Q), branch="front-down")
    assert str(best.branch) == "front-down"
    assert best.reason


def test_jacobians_are_the_derivative_of_forward_kinematics(arm: katana450.Arm) -> None:
    h = 1e-6
    T = arm.fk(Q)
    for axis, step in enumerate(h * np.eye(5)):
        rate = (arm.fk(Q + step) - arm.fk(Q - step)) / (2.0 * h)
        for V, hat in (
            (arm.jacobian(Q)[:, axis], rate @ se3.inverse(T)),
            (arm.jacobian(Q, body=True)[:, axis], se3.inverse(T) @ rate),
        ):
            np.testing.assert_allclose(se3.hat(V), hat, atol=1e-8)


def test_reachability_map_is_in_the_base_frame(shoulder_arm: katana450.Arm) -> None:
    reachability = shoulder_arm.reachability(0.2)
    assert (reachability.points[:, 2] > 0.0).all()
    assert ((reachability.fraction > 0.0) & (reachability.fraction <= 1.0)).all()


Refused = Callable[[katana450.Arm], Any]

REFUSED: dict[str, tuple[Refused, str]] = {
    "angles of another arm": (lambda arm: arm.fk([0.0] * 6), r"shape \(6,\)"),
    "angles in a box": (lambda arm: arm.fk(np.zeros((2, 2, 5))), "shape"),
    "no number": (lambda arm: arm.fk([0.0, 0.0, 0.0, 0.0, np.nan]), "axis 5"),
    "no number among many": (lambda arm: arm.fk([[0.0] * 5, [np.inf] + [0.0] * 4]), "vector 1"),
    "ragged": (lambda arm: arm.fk([[0.0], [0.0, 1.0]]), "regular"),
    "words": (lambda arm: arm.fk(["a"] * 5), "numbers"),
    "pose of rows": (lambda arm: arm.ik(np.eye(3)), "shape"),
    "pose with NaN": (lambda arm: arm.ik(np.full((4, 4), np.nan)), "nan"),
    "no rotation": (lambda arm: arm.ik(np.diag([2.0, 1.0, 1.0, 1.0])), "rotation"),
    "one of many": (lambda arm: arm.ik(np.array([np.eye(4), 2.0 * np.eye(4)])), "ose 1"),
    "long quaternion": (lambda arm: arm.ik(([0.3, 0.0, 0.0], [1.0] * 4)), "length 2"),
    "nearest to nothing": (lambda arm: arm.nearest(np.zeros((4, 4))), "last row"),
    "unknown priority": (lambda arm: arm.nearest(np.eye(4), priority="yaw"), "'yaw'"),  # type: ignore[arg-type]
    "unknown branch": (lambda arm: arm.nearest(np.eye(4), branch="left"), "front-up"),
    "short jacobian": (lambda arm: arm.jacobian([0.0]), "shape"),
    "huge voxel": (lambda arm: arm.reachability(10.0), "voxel"),
    "unknown frame": (lambda arm: katana450.load(frame="world"), "'world'"),  # type: ignore[arg-type]  # noqa: ARG005
    "no such scene": (lambda arm: katana450.load(scene="/nowhere.yaml"), "nowhere"),  # noqa: ARG005
}


@pytest.mark.parametrize("case", REFUSED)
def test_unusable_input_is_refused_with_the_reason(arm: katana450.Arm, case: str) -> None:
    call, message = REFUSED[case]
    with pytest.raises(katana450.InputError, match=message):
        call(arm)


@pytest.mark.parametrize(
    ("file", "tool", "message"),
    [
        (GANTRY, None, "axis|axes|joint"),
        (Path("/nowhere/arm.urdf"), None, "nowhere"),
        (None, "hand", "no link 'hand'"),
    ],
)
def test_other_mechanisms_and_tools_are_refused(
    file: Path | None, tool: str | None, message: str
) -> None:
    with pytest.raises(katana450.RobotDescriptionError, match=message):
        katana450.load(file, tool)


@pytest.mark.parametrize("decimals", [4, 6])
def test_printed_pose_is_solved_and_its_misfit_is_stated(arm: katana450.Arm, decimals: int) -> None:
    poses = arm.fk(postures(arm, 20))
    printed = poses.round(decimals)
    feasible = 0
    for T, text in zip(poses, printed, strict=True):
        solutions = arm.ik(text)
        assert isinstance(solutions.rotation_misfit, float)
        assert 0.0 < solutions.rotation_misfit <= 2.0 * 10.0**-decimals
        assert arm.nearest(text).position_error < 2.0 * 10.0**-decimals
        assert arm.ik(T).rotation_misfit < 1e-14
        feasible += bool(solutions.feasible)
    assert feasible >= 18
    misfits = arm.ik(printed).rotation_misfit
    np.testing.assert_array_equal(misfits, [arm.ik(pose).rotation_misfit for pose in printed])


def test_pose_in_millimetres_is_asked_about(arm: katana450.Arm) -> None:
    T = arm.fk(Q)
    T[:3, 3] *= 1e3
    asks = (
        lambda: arm.ik(T),
        lambda: arm.ik(np.stack((arm.fk(Q), T))),
        lambda: arm.nearest(T),
        lambda: arm.plan(T),
    )
    for ask in asks:
        with pytest.raises(katana450.InputError, match="Did you mean metres"):
            ask()


def test_angle_in_degrees_is_asked_about(arm: katana450.Arm) -> None:
    for ask in (lambda: arm.line(pitch=30.0), lambda: arm.ik(([0.3, 0.0, 0.1], [0.0, 30.0, 0.0]))):
        with pytest.raises(katana450.InputError, match=r"mean radians\? 30 deg are 0.5236 rad"):
            ask()


def test_pose_is_given_in_several_forms(arm: katana450.Arm) -> None:
    T = arm.fk(Q)
    pose = katana450.SE3(T)
    assert not pose.matrix.flags.writeable
    forms: dict[str, Any] = {
        "rows": T.tolist(),
        "SE3": pose,
        "quaternion": (pose.position, pose.wxyz),
        "roll, pitch, yaw": [pose.position, pose.rpy],
    }
    expected = arm.ik(T).q
    wrong = []
    for name, form in forms.items():
        if np.abs(arm.ik(form).q - expected).max() > 1e-12 or not arm.ik(form).feasible:
            wrong.append(name)
        if arm.nearest(form).position_error > 1e-12:
            wrong.append(f"nearest, {name}")
    assert not wrong
    np.testing.assert_array_equal(arm.ik([pose, pose]).q, arm.ik(np.stack((T, T))).q)
    assert arm.plan((pose.position, pose.wxyz)).end == pytest.approx(Q, abs=1e-9)


def test_poses_compose() -> None:
    a = katana450.SE3.from_rpy([0.3, 0.1, 0.2], [0.4, -0.5, 2.0])
    b = katana450.SE3.from_quaternion([0.0, 0.1, 0.0], [0.5, 0.5, -0.5, 0.5])
    for product in (a @ b, a @ b.matrix, a.matrix @ b):
        assert isinstance(product, katana450.SE3)
        np.testing.assert_allclose(product.matrix, a.matrix @ b.matrix, atol=1e-15)
    np.testing.assert_allclose((a @ a.inverse()).matrix, np.eye(4), atol=1e-15)
    np.testing.assert_allclose(a @ b.position, (a @ b).position, atol=1e-15)
    np.testing.assert_allclose(a @ np.stack([b.position] * 2), [(a @ b).position] * 2, atol=1e-15)
    np.testing.assert_allclose(a.rpy, [0.4, -0.5, 2.0], atol=1e-15)
    for wrong, words in ((np.zeros(5), "points"), (2.0 * np.eye(4), "last row")):
        with pytest.raises(katana450.InputError, match=words):
            _ = a @ wrong
