"""Texts of the state: every reason has a sentence that contains its number."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.session.tool_targets import BranchOption
from katana450.arm.control.state.messages import (
    AXIS_NAMES,
    PRIORITIES,
    PRIORITY_HINTS,
    REASONS,
    STATUS,
    axis_label,
    axis_names,
    degrees,
    excluded,
    headline,
    limit_text,
    millimetres,
    sentence,
    title,
)
from katana450.arm.control.state.state import Finding, Reason, State, Status
from katana450.maths.collision.engine import Contact
from katana450.maths.kinematics.branch import BRANCHES
from katana450.server.view.panel import HEADINGS, cells_of
from katana450.server.view.view import GHOST_COLOURS


def with_findings(state: State, *findings: Finding) -> State:
    return replace(state, findings=findings)


@pytest.mark.parametrize("reason", Reason)
def test_every_reason_has_a_sentence(state: State, reason: Reason) -> None:
    text = sentence(with_findings(state, Finding(reason, 0.5, 1)))
    assert not text[0].islower()
    assert text.endswith(".")


def test_texts_and_kinds_match() -> None:
    assert set(REASONS) == set(Reason)
    assert set(STATUS) == set(Status)
    assert set(PRIORITIES) == set(PRIORITY_HINTS)
    assert set(GHOST_COLOURS) == set(Status)
    assert len(AXIS_NAMES) == 5


def test_joints_have_names_for_people() -> None:
    for numbered in ("axis_{}", "axis{}", "{}"):
        assert axis_names([numbered.format(number) for number in range(1, 6)]) == AXIS_NAMES
    assert list(axis_names(["shoulder_pan_joint", "wrist_1_joint", "joint_8", "j2"])) == [
        "shoulder pan",
        "wrist 1",
        "joint 8",
        "j2",
    ]
    assert list(axis_names(["left_arm_pan", "left_arm_lift_joint"])) == ["pan", "lift"]
    assert list(axis_names(["joint_1", "joint_2"])) == ["joint 1", "joint 2"]
    panda = [f"panda_joint{number}" for number in range(1, 8)]
    assert [axis_label(number, name) for number, name in enumerate(axis_names(panda), 1)] == [
        f"joint {number}" for number in range(1, 8)
    ]
    assert axis_label(4, "wrist 1") == "4 wrist 1"


@pytest.mark.parametrize(
    ("finding", "expected"),
    [
        (Finding(Reason.OUT_OF_REACH, 0.032), "32 mm out of reach."),
        (Finding(Reason.OUT_OF_REACH, 0.0013), "1.3 mm out of reach."),
        (
            Finding(Reason.YAW_FIXED, math.radians(23.0)),
            "Wrist yaw is fixed by position: 23° off.",
        ),
        (Finding(Reason.AXIS_LIMIT, math.radians(7.75), 1), "Axis 2 at its limit of 7.75°."),
        (
            Finding(Reason.AXIS_LIMIT, math.radians(-173.35), 0),
            "Axis 1 at its limit of −173.35°.",
        ),
    ],
)
def test_the_numbers_are_in_the_sentence(state: State, finding: Finding, expected: str) -> None:
    assert sentence(with_findings(state, finding)) == expected


def test_gap_is_reported_with_the_axis_and_the_leap(state: State) -> None:
    held = with_findings(
        state,
        Finding(Reason.ACROSS_GAP, math.radians(68.4), 3),
        Finding(Reason.POSITION_CHANGED, 0.0123),
    )
    assert sentence(held) == (
        "Axis 4 would have to leap 68° to follow: drag along another path, or choose the pose "
        "under Branches; position gives way by 12 mm."
    )
    assert headline(held) == STATUS[Status.GAP]


def test_reasons_about_the_goal_say_so_while_the_arm_moves(state: State) -> None:
    limited = with_findings(state, Finding(Reason.AXIS_LIMIT, math.radians(7.75), 1))
    moving = replace(limited, goal=state.goal + 0.1)
    assert headline(moving) == "Moving as near as it can"
    assert sentence(moving) == "At the goal: axis 2 at its limit of 7.75°."


def test_contact_is_reported_with_both_parts_and_the_distance(state: State) -> None:
    parts = ("finger_left_link", "upper_arm_link")
    blocked = with_findings(state, Finding(Reason.CONTACT, 0.0083, parts=parts))
    assert blocked.status is Status.BLOCKED
    assert sentence(blocked) == (
        "Left finger and upper arm are 8.3 mm apart: the arm stops at 5.0 mm."
    )
    assert headline(blocked) == STATUS[Status.BLOCKED]


def test_nearest_limit_is_reported_with_its_axis() -> None:
    assert limit_text(1, "shoulder", math.radians(7.31)) == "2 shoulder: 7.3° left"


@pytest.mark.parametrize(
    ("position_error", "rotation_error", "parts", "expected"),
    [
        (0.0, 0.0, None, "nothing"),
        (0.0123, 0.0, None, "12 mm"),
        (0.0, math.radians(4.5), None, "4.5°"),
        (0.0123, math.radians(4.5), None, "12 mm, 4.5°"),
        (0.0123, 0.0, ("pan_link", "basin"), "12 mm, shoulder meets basin"),
    ],
)
def test_branch_cells_have_three_texts(
    state: State,
    position_error: float,
    rotation_error: float,
    parts: tuple[str, str] | None,
    expected: str,
) -> None:
    contact = None if parts is None else Contact(parts, 0.001, np.zeros((2, 3)), np.eye(3)[2])
    errors, cost = (position_error, rotation_error), (math.radians(90), 1.318, 0.1512)
    choice = BranchOption(BRANCHES[0], state.q, True, *errors, *cost, contact)
    assert cells_of(choice) == (expected, "90°, 1.3 s", "0.151")
    assert len(HEADINGS) == 1 + len(cells_of(choice))


def test_branch_that_the_limits_exclude_has_their_axes_in_place_of_numbers(state: State) -> None:
    for axes, expected in (((2,), "limits of axis 3"), ((0, 2, 3), "limits of axes 1, 3 and 4")):
        refusal = excluded("back-up", axes)
        choice = BranchOption(BRANCHES[0], state.q, True, *(0.1,) * 5, None, refusal)
        assert cells_of(choice) == (expected, "–", "–")
        assert "exclude the branch back-up" in choice.refusal


def test_state_without_findings_has_no_sentence(state: State) -> None:
    assert sentence(state) == ""
    assert headline(state) == STATUS[Status.OK]


def test_no_negative_zero() -> None:
    assert degrees(-1e-9) == "0.0°"
    assert millimetres(-1e-9) == "0.0 mm"
    assert degrees(-0.5, 0) == "−29°"


@pytest.mark.parametrize(
    ("robot", "expected"), [("katana450", "Katana450"), ("youbot_arm", "Youbot arm"), ("", "")]
)
def test_a_page_is_named_after_its_robot(robot: str, expected: str) -> None:
    assert title(robot) == expected
