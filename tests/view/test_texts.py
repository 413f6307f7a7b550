"""Every reason has its sentence, with its number in it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from app.control.session import Session
from app.control.state import Finding, Reason, State, Status
from app.view.texts import AXIS_NAMES, REASONS, STATUS, degrees, headline, millimetres, sentence


@pytest.fixture
def state(session: Session) -> State:
    return session.begin(session.ready, 0.0, 0.0)


def with_findings(state: State, *findings: Finding) -> State:
    return replace(state, findings=findings)


@pytest.mark.parametrize("reason", Reason)
def test_every_reason_has_a_sentence(state: State, reason: Reason) -> None:
    told = sentence(with_findings(state, Finding(reason, 0.5, 1)))
    assert not told[0].islower()
    assert told.endswith(".")


@pytest.mark.parametrize("status", Status)
def test_every_status_has_a_headline(status: Status) -> None:
    assert STATUS[status]


def test_no_text_is_left_over() -> None:
    assert set(REASONS) == set(Reason)
    assert set(STATUS) == set(Status)
    assert len(AXIS_NAMES) == 5


@pytest.mark.parametrize(
    ("finding", "said"),
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
def test_the_numbers_are_in_the_sentence(state: State, finding: Finding, said: str) -> None:
    assert sentence(with_findings(state, finding)) == said


def test_two_reasons_make_one_sentence(state: State) -> None:
    said = sentence(
        with_findings(
            state,
            Finding(Reason.OUT_OF_REACH, 0.032),
            Finding(Reason.AXIS_LIMIT, math.radians(7.75), 1),
        )
    )
    assert said == "32 mm out of reach; axis 2 at its limit of 7.75°."


def test_nothing_wrong_nothing_said(state: State) -> None:
    assert sentence(state) == ""
    assert headline(state) == STATUS[Status.OK]


def test_no_negative_zero() -> None:
    assert degrees(-1e-9) == "0.0°"
    assert millimetres(-1e-9) == "0.0 mm"
    assert degrees(-0.5, 0) == "−29°"
