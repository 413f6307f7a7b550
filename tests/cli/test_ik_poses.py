"""``katana450 ik`` takes a pose in every common form, with the nearest posture."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import pitch_and_roll
from tests.cli.lines import ask


def random_postures(arm: MountedArm, count: int) -> FloatArray:
    chain = arm.chain
    return np.random.default_rng(450).uniform(chain.lower, chain.upper, (count, chain.n))


def forms(T: FloatArray) -> list[dict[str, Any]]:
    """Return the pose ``T`` (4, 4) in every form."""
    w, x, y, z = so3.to_quaternion(T[:3, :3]).tolist()
    p, rpy = T[:3, 3].tolist(), list(so3.to_rpy(T[:3, :3]))
    return [
        {"T": T.tolist()},
        {"p": p, "wxyz": [w, x, y, z]},
        {"p": p, "xyzw": [x, y, z, w]},
        {"p": p, "rpy": rpy},
    ]


@pytest.mark.parametrize("frame", ["shoulder", "base"])
def test_every_form_of_a_pose_gives_the_same_solutions(arm: MountedArm, frame: str) -> None:
    T_frame_shoulder = arm.T_base_shoulder if frame == "base" else np.eye(4)
    for q in random_postures(arm, 20):
        T = T_frame_shoulder @ forward(arm.chain, q)
        for answer in ask("ik", forms(T), "--frame", frame):
            assert min(np.abs(np.array(s["q"]) - q).max() for s in answer["solutions"]) < 1e-6
            assert answer["rotation_misfit"] < 1e-12


def test_pitch_and_roll_leave_the_yaw_to_the_arm(arm: MountedArm) -> None:
    for q in random_postures(arm, 40):
        pitch, roll = pitch_and_roll(arm.chain, q)
        p = forward(arm.chain, q)[:3, 3]
        request = {"p": p.tolist(), "pitch": pitch, "roll": roll}
        (answer,) = ask("ik", [request])
        assert answer["residual_mm"] < 1e-9
        assert answer["residual_rad"] < 1e-9
        same = 0
        for solution in answer["solutions"]:
            posture = np.array(solution["q"])
            np.testing.assert_allclose(forward(arm.chain, posture)[:3, 3], p, atol=1e-9)
            other = np.array(pitch_and_roll(arm.chain, posture)) - (pitch, roll)
            same += bool(np.abs(np.sin(0.5 * other)).max() < 1e-8)
        assert same > 0


BAD = [
    ({"p": [0.3, 0.0, 0.1]}, "this has p"),
    ({"wxyz": [1, 0, 0, 0]}, "this has wxyz"),
    ({"p": [0.3, 0.0, 0.1], "wxyz": [1, 0, 0, 0], "rpy": [0, 0, 0]}, "one orientation"),
    ({"p": [0.3, 0.0, 0.1], "pitch": 0.1}, "both pitch and roll"),
    ({"p": [0.3, 0.0, 0.1], "pitch": None, "roll": 0.0}, "pitch is not of plain finite numbers"),
    ({"p": [0.3, 0.0], "rpy": [0, 0, 0]}, "p "),
    ({"p": [0.3, 0.0, True], "rpy": [0, 0, 0]}, "got `bool` - at `$[2]`"),
    ({"p": [0.3, 0.0, 0.1], "wxyz": [2, 0, 0, 0]}, "the length 2,"),
    ({"p": [0.3, 0.0, 0.1], "wxyz": [0, 0, 0, 0]}, "The quaternion is zero"),
    ({"T": np.eye(4).tolist(), "p": [0, 0, 0]}, "A pose is T, or p with one orientation"),
]


@pytest.mark.parametrize(("request_", "expected"), BAD)
def test_wrong_pose_is_refused_with_the_key_at_fault(
    request_: dict[str, Any], expected: str
) -> None:
    (answer,) = ask("ik", [request_], status=1)
    assert expected in answer["error"]


def test_nearest_is_inside_the_limits_and_names_the_binding_one(arm: MountedArm) -> None:
    q = np.array(arm.chain.clamp(np.zeros(5)))
    q[4] = arm.chain.upper[4] + 0.1
    T = forward(arm.chain, q)
    (answer,) = ask("ik", [{"T": T.tolist(), "q": q.tolist()}], "--nearest")
    nearest = answer["nearest"]
    assert arm.chain.within_limits(np.array(nearest["q"]))
    assert nearest["limits"] == [5]
    assert "axis 5 at its limit" in nearest["reason"]
    (plain,) = ask("ik", [{"T": T.tolist()}])
    assert "nearest" not in plain
