from __future__ import annotations

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import joint_frames


def test_four_branches_are_named_by_text() -> None:
    assert len(set(BRANCHES)) == 4
    assert [str(b) for b in BRANCHES] == ["front-up", "front-down", "back-up", "back-down"]
    assert all(Branch.parse(str(b)) == b for b in BRANCHES)


@pytest.mark.parametrize("text", ["", "front", "front-left", "FRONT-UP", "up-front"])
def test_other_text_is_refused_with_the_names(text: str) -> None:
    with pytest.raises(InputError, match="front-up, front-down, back-up, back-down"):
        Branch.parse(text)


def test_front_means_the_arm_faces_the_tool_point(chain: Chain) -> None:
    assert branch_of(chain, [1.0, -0.4, 0.8, 0.1, 0.0]) == Branch("front", "up")
    # Leaning far back with the tool over its shoulder.
    assert branch_of(chain, [1.0, -2.1, -1.0, 0.0, 0.0]) == Branch("back", "down")
    assert branch_of(chain, np.zeros(5)).shoulder == "front"


def test_elbow_up_is_above_the_line_from_shoulder_to_wrist(
    chain: Chain, rng: np.random.Generator
) -> None:
    for q in rng.uniform(chain.lower, chain.upper, size=(200, 5)):
        frames = joint_frames(chain, q)
        elbow = frames[1] @ [0.190, 0.0, 0.0, 1.0]
        wrist = frames[2] @ [0.329, 0.0, 0.0, 1.0]
        # The arm's plane is spanned by its outward direction and z; its normal is axis 2.
        normal = frames[0][:3, 1]
        above = normal @ np.cross(elbow[:3], wrist[:3]) > 0.0
        assert (branch_of(chain, q).elbow == "up") == above


def test_a_whole_turn_changes_no_branch(chain: Chain) -> None:
    q = np.array([0.3, -0.5, -0.7, 0.4, 0.2])
    assert branch_of(chain, q) == branch_of(chain, q + 2.0 * np.pi)
