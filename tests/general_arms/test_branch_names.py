"""The names of branches say what a person sees at the arm."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
import pytest

from katana450.extensions.general_arms.branch_words import BranchWords
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.general_arms.seven_axes import SevenAxes
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space
from tests.general_arms.published_arms import (
    FOUR,
    IIWA_7,
    KR_6,
    OPENMANIPULATOR_X,
    PANDA,
    PINCHERX_100,
    PUMA_560,
    SEVEN,
    SIX,
    TOOL,
    UR5E,
)

ARMS = {**FOUR, **SIX, **SEVEN}
POSTURES = 80
CLEAR = 0.02
"""[m] or [1] What a person sees as clearly more than nothing."""


class Seen(NamedTuple):
    """The axes of a posture: directions and points (n, 3), and the pose of the tool (4, 4)."""

    z: FloatArray
    p: FloatArray
    T: FloatArray

    def meeting(self, i: int, j: int) -> FloatArray:
        """Return where two axes meet, by least squares."""
        A = np.column_stack((self.z[i], -self.z[j]))
        along = np.linalg.lstsq(A, self.p[j] - self.p[i], rcond=None)[0]
        point: FloatArray = self.p[i] + along[0] * self.z[i]
        return point


def seen(chain: Chain, q: FloatArray) -> Seen:
    S = jacobian_space(chain, q)
    z = S[:3].T
    return Seen(z, np.cross(z, S[3:].T), forward(chain, q))


def name_of(chain: Chain, q: FloatArray) -> list[str]:
    return str(DrivenTool(chain).branch_of(q)).split("-")


def postures(chain: Chain, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(chain.lower, chain.upper, (POSTURES, chain.n))


def heading(axes: Seen, wrist: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the horizontal direction from axis 1 to the wrist, and the one to its left."""
    out = wrist - axes.p[0]
    out = out - out @ axes.z[0] * axes.z[0]
    out /= np.linalg.norm(out)
    return out, np.cross((0.0, 0.0, 1.0), out)


def above(shoulder: FloatArray, elbow: FloatArray, wrist: FloatArray, front: FloatArray) -> float:
    """Return the height of the elbow over the line from shoulder to wrist [m], from the side."""
    elbow, wrist = elbow - shoulder, wrist - shoulder
    return float(elbow[2] - wrist[2] * (elbow @ front) / (wrist @ front))


FLANGE = se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, 0.1]))
"""A tool along the last axis, as most tools are."""


def straight(chain: Chain) -> Chain:
    """Return the arm with FLANGE in place of a skewed tool."""
    return chain.with_tool(chain.M @ se3.inverse(TOOL) @ FLANGE)


HOMES = {
    # Forearm level, tool down.
    "UR5e": (straight(UR5E), "right-up-noflip"),
    # Upper arm level, forearm and tool up.
    "Puma 560": (straight(PUMA_560), "left-down-flip"),
    # Tool up.
    "KR 6": (straight(KR_6), "front-up-flip"),
    # The upper arm leans back; forearm level, tool down.
    "Panda": (straight(PANDA), "back-up-noflip"),
    # Tool up.
    "iiwa": (straight(IIWA_7), "front-up-flip"),
    "OpenMANIPULATOR-X": (OPENMANIPULATOR_X, "front-up"),
    "PincherX-100": (PINCHERX_100, "front-up"),
}


@pytest.mark.parametrize("name", HOMES)
def test_home_has_the_name_of_what_is_seen(name: str) -> None:
    chain, expected = HOMES[name]
    assert "-".join(name_of(chain, DrivenTool(chain).ready((), np.eye(4)))) == expected


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("chain", "q", "expected"),
    [
        # Forearm level, tool down: the usual posture for picking, with the base turned either way.
        (UR5E, (0, -90, 90, -90, -90, 0), "left-up-noflip"),
        (UR5E, (0, -90, -90, -90, 90, 0), "right-up-noflip"),
        (UR5E, (0, -90, 90, -90, 90, 0), "left-up-flip"),
        (PUMA_560, (0, -45, 180, 0, -45, 0), "left-up-flip"),
        (PUMA_560, (0, -45, 180, 0, 45, 0), "left-up-noflip"),
        (KR_6, (0, -90, 90, 0, 90, 0), "front-up-noflip"),
        # The hand is where it was, with the forearm turned over.
        (KR_6, (0, -90, 90, 180, -90, 0), "front-up-flip"),
        (PANDA, (0, -45, 0, -135, 0, 90, 45), "back-up-noflip"),
        (IIWA_7, (0, 30, 0, -60, 0, 90, 0), "front-up-noflip"),
        (IIWA_7, (0, 30, 0, -60, 0, -60, 0), "front-up-flip"),
        (OPENMANIPULATOR_X, (0, -60, 20, 40), "front-up"),
        (PINCHERX_100, (0, 0, 0, 0), "front-up"),
    ],
)
def test_known_posture_has_the_name_of_what_is_seen(
    chain: Chain, q: tuple[float, ...], expected: str
) -> None:
    assert "-".join(name_of(chain, np.radians(q))) == expected


@pytest.mark.cases(1)
@pytest.mark.parametrize("chain", [UR5E, PUMA_560], ids=["UR5e", "Puma 560"])
def test_arm_is_left_or_right_of_axis_1_as_seen_from_there(chain: Chain) -> None:
    for q in postures(chain, 1):
        axes = seen(chain, q)
        wrist = axes.meeting(4, 5)
        _, left = heading(axes, wrist)
        sideways = axes.z[1] * float(axes.z[1] @ (wrist - axes.p[0]))
        assert name_of(chain, q)[0] == ("left" if sideways @ left > 0.0 else "right")


def test_wrist_is_on_the_side_of_the_shoulder_or_behind_axis_1() -> None:
    for q in postures(KR_6, 2):
        axes = seen(KR_6, q)
        shoulder, wrist = axes.meeting(1, 0), axes.meeting(4, 5)
        side = float(shoulder[:2] @ wrist[:2])
        assert name_of(KR_6, q)[0] == ("front" if side > 0.0 else "back")


@pytest.mark.cases(1)
@pytest.mark.parametrize("chain", FOUR.values(), ids=FOUR)
def test_tool_is_on_the_side_to_which_four_axes_face(chain: Chain) -> None:
    for q in postures(chain, 3):
        facing = np.array((np.cos(q[0]), np.sin(q[0])))
        place = seen(chain, q).T[:2, 3] - seen(chain, q).p[0][:2]
        assert name_of(chain, q)[0] == ("front" if place @ facing > 0.0 else "back")


def test_upper_arm_of_a_panda_leans_to_the_front_or_back() -> None:
    for q in postures(PANDA, 4):
        axes = seen(PANDA, q)
        elbow = axes.meeting(3, 4) - axes.meeting(1, 0)
        # Beside the elbow, axis 3 is the axis of the upper arm.
        up = axes.z[2] * float(axes.z[2] @ elbow)
        leans = up[:2] @ (np.cos(q[0]), np.sin(q[0]))
        assert name_of(PANDA, q)[0] == ("front" if leans > 0.0 else "back")


@pytest.mark.parametrize("name", ["UR5e", "Puma 560", "KR 6", *FOUR])
def test_elbow_is_above_or_below_the_line_from_shoulder_to_wrist(name: str) -> None:
    chain, checked = ARMS[name], 0
    for q in postures(chain, 5):
        axes = seen(chain, q)
        wrist = axes.meeting(4, 5) if chain.n == 6 and name != "UR5e" else axes.p[3]
        centre = axes.T[:3, 3] if chain.n == 4 else axes.meeting(4, 5)
        out, _ = heading(axes, centre)
        if name not in ("UR5e", "Puma 560"):
            out = out if name_of(chain, q)[0] == "front" else -out
        # Points in the arm's plane, which axis 2 crosses.
        front = np.cross(axes.z[1], (0.0, 0.0, 1.0))
        front *= np.sign(front @ out)
        if (wrist - axes.p[1]) @ front < CLEAR:
            continue
        higher = above(axes.p[1], axes.p[2], wrist, front)
        if abs(higher) > CLEAR:
            assert name_of(chain, q)[1] == ("up" if higher > 0.0 else "down")
            checked += 1
    assert checked > POSTURES / 10


@pytest.mark.parametrize("name", ["Puma 560", "KR 6", "iiwa"])
def test_hand_bends_down_or_up_while_the_forearm_is_not_rolled(name: str) -> None:
    chain = straight(ARMS[name])
    rolls = {"iiwa": [0, 2, 4]}.get(name, [3])
    for q in postures(chain, 6):
        seen_as = name_of(chain, q)
        still = q.copy()
        still[rolls] = 0.0
        axes = seen(chain, still)
        centre = axes.meeting(-3, -2)
        elbow = axes.p[3] if name == "iiwa" else axes.p[2]
        forearm = axes.z[-3] * np.sign(axes.z[-3] @ (centre - elbow))
        hand = axes.T[:3, 3] - centre
        if name == "Puma 560":
            _, left = heading(seen(chain, q), seen(chain, q).meeting(4, 5))
        else:
            left = np.array((-np.sin(still[0]), np.cos(still[0]), 0.0))
        down = float(left @ np.cross(forearm, hand))
        if abs(down) > 0.1 * CLEAR:
            assert seen_as[2] == ("noflip" if down > 0.0 else "flip")


def test_wrist_of_a_ur_leads_to_the_front_or_back_when_the_tool_points_down() -> None:
    for q in postures(UR5E, 7):
        axes = seen(straight(UR5E), q)
        wrist = axes.meeting(4, 5)
        left = axes.z[1] * np.sign(axes.z[1] @ heading(axes, wrist)[1])
        # Whatever its direction, the tool is seen from the side as if it pointed down.
        hand = axes.z[5] * np.sign(axes.z[5] @ (axes.T[:3, 3] - wrist))
        outward = wrist - axes.meeting(3, 4)
        front = float(outward @ np.cross(hand, left))
        if abs(front) > 0.1 * CLEAR:
            assert name_of(UR5E, q)[2] == ("noflip" if front > 0.0 else "flip")


@pytest.mark.parametrize("name", ARMS)
def test_names_do_not_depend_on_the_directions_of_the_axes_in_the_file(name: str) -> None:
    chain = ARMS[name]
    rng = np.random.default_rng(8)
    signs = rng.choice((-1.0, 1.0), chain.n)
    lower, upper = np.sort((signs * chain.lower, signs * chain.upper), axis=0)
    turned = dataclasses.replace(chain, S=chain.S * signs, lower=lower, upper=upper)
    for q in postures(chain, 9)[:20]:
        np.testing.assert_allclose(forward(turned, signs * q), forward(chain, q), atol=1e-12)
        assert name_of(turned, signs * q) == name_of(chain, q)


@pytest.mark.cases(6)
@pytest.mark.parametrize("name", ARMS)
def test_solution_of_each_branch_looks_as_its_name_says(name: str) -> None:
    chain = ARMS[name]
    solver = kinematics_of(chain)
    assert isinstance(solver, ClosedForm | SevenAxes)
    assert len(set(solver.branches)) == len(solver.branches) == (4 if chain.n == 4 else 8)
    joints = tuple(k for k in range(chain.n) if k != solver.arm_angle_joint)
    words = BranchWords(chain, joints, isinstance(solver, SevenAxes) and solver.is_reversed)
    for q in postures(chain, 10)[:10]:
        for solution in solver.inverse(forward(chain, q), q):
            if solution.exact and not (chain.n < 7 and solution.singular):
                assert words.of(solution.q) == solution.branch
