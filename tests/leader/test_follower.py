"""The rules of following: what ends it, and what begins it again."""

from __future__ import annotations

import math
from typing import Any

import pytest

from katana450.extensions.leader.follower import (
    Action,
    Ease,
    EndEase,
    FingerTarget,
    LeadPhase,
    ReleaseControl,
    Sample,
    Say,
)
from tests.leader.follower_bench import PERIOD, Bench, N, program


def texts(actions: list[Action]) -> str:
    return " ".join(action.text for action in actions if isinstance(action, Say))


def samples(actions: list[Action]) -> list[Sample]:
    return [action for action in actions if isinstance(action, Sample)]


def test_arm_eases_to_the_leader_and_then_follows_with_rates() -> None:
    bench = Bench()
    assert not bench.step(5)
    eases = [action for action in bench.step(is_asked=True) if isinstance(action, Ease)]
    assert eases[0].q == pytest.approx([0.3] * N)
    assert eases[0].revocations == 4
    # A program that ended before does not count as the present one.
    bench.values["program"] = program("done")
    assert not bench.step(10)
    bench.arrive(0.3)
    assert "follows" in texts(bench.step(2))
    passed: list[Sample] = []
    for _ in range(30):
        bench.angle += 0.5 * PERIOD
        passed += samples(bench.step())
    assert [sample.first for sample in passed] == [True] + 29 * [False]
    assert passed[-1].q == pytest.approx([0.45] * N)
    assert passed[-1].qd == pytest.approx([0.5] * N, abs=1e-6)
    assert passed[-1].revocations == 5


def test_leader_that_moved_meanwhile_is_approached_on_another_plan_once_it_rests() -> None:
    bench = Bench()
    bench.step(60)
    bench.step(is_asked=True)
    bench.angle = 0.4
    bench.step(10)
    bench.arrive(0.3)
    assert "Keep it still" in texts(bench.step())
    for i in range(100):
        bench.angle = 0.6 + 0.05 * math.sin(0.3 * i)
        assert not any(isinstance(action, Ease | Sample) for action in bench.step())
    bench.angle = 0.6
    again = [action for action in bench.step(60) if isinstance(action, Ease)]
    assert len(again) == 1
    assert again[0].q == pytest.approx([0.6] * N)
    assert bench.follower.phase is LeadPhase.EASING


def test_arm_that_a_person_gives_back_eases_to_the_leader_again() -> None:
    bench = Bench()
    bench.follow()
    bench.values["holder"] = "Ada"
    assert "changed its driver" in texts(bench.step())
    assert not any(isinstance(action, Ease | Sample) for action in bench.step(60))
    bench.values |= {"holder": "Leader", "revocations": 7}
    assert [action.revocations for action in bench.step(5) if isinstance(action, Ease)] == [7]


ENDS: dict[str, dict[str, Any]] = {
    "sent no valid posture": {"answers": False},
    "server does not answer": {"server_answers": False},
    "stopped: Ada pressed STOP.": {"values": {"stopped": "Ada pressed STOP.", "revocations": 6}},
    "changed its driver": {"values": {"revocations": 6}},
    "was paused": {"values": {"status": "paused"}},
    "held back: The hand meets": {
        "values": {"status": "blocked", "why": "The hand meets the cup.", "setpoint": [-0.3] * N}
    },
}


@pytest.mark.parametrize("why", ENDS)
def test_unexpected_event_ends_following_until_a_person_asks(why: str) -> None:
    bench = Bench()
    bench.follow()
    bench.step()
    values = dict(bench.values)
    change = dict(ENDS[why])
    bench.values |= change.pop("values", {})
    for name, value in change.items():
        setattr(bench, name, value)
    assert why in texts(bench.step(150))
    assert bench.follower.phase is LeadPhase.WAITING
    # The cause ends, and the leader moves: nothing follows.
    bench.answers = bench.server_answers = True
    bench.values = values | {"revocations": bench.values["revocations"], "moving": True}
    for _ in range(200):
        bench.angle += 0.001
        assert set(bench.step()) <= {ReleaseControl()}
    assert any(isinstance(action, Ease) for action in bench.step(is_asked=True))


@pytest.mark.parametrize("status", ["stopped", "failed", "refused", "cancelled", "ready"])
def test_program_that_does_not_arrive_ends_it(status: str) -> None:
    bench = Bench()
    bench.step(5)
    bench.step(is_asked=True)
    bench.arrive(0.0)
    bench.values["program"] = program(status, "Not run: the arm has moved.")
    assert "did not reach" in texts(bench.step())
    assert bench.follower.phase is LeadPhase.WAITING


def test_silent_leader_ends_the_planned_motion_too() -> None:
    bench = Bench()
    bench.step(5)
    bench.step(is_asked=True)
    bench.answers = False
    actions = bench.step(150)
    assert EndEase() in actions
    assert "no valid posture" in texts(actions)


def test_stopped_arm_and_silent_leader_refuse_to_begin() -> None:
    bench = Bench()
    bench.values["stopped"] = "Ada pressed STOP."
    bench.step(5)
    assert "Clear the stop first" in texts(bench.step(is_asked=True))
    bench.answers = False
    bench.step(150)
    assert "does not answer" in texts(bench.step(is_asked=True))
    assert bench.follower.phase is LeadPhase.WAITING


def test_silent_leader_does_not_count_as_one_at_rest() -> None:
    bench = Bench()
    bench.step(60)
    bench.step(is_asked=True)
    bench.step(60)
    bench.answers = False
    # Its last postures are equal, but 0.3 s old.
    bench.step(30)
    bench.arrive(0.0)
    assert not any(isinstance(action, Ease) for action in bench.step(30))
    bench.answers = True
    assert any(isinstance(action, Ease) for action in bench.step())


def test_jumps_are_refused_and_end_it_if_they_last() -> None:
    bench = Bench()
    bench.follow()
    bench.angle += 2.0 * math.pi
    assert not samples(bench.step())
    bench.angle -= 2.0 * math.pi
    assert samples(bench.step())
    bench.angle += 2.0 * math.pi
    actions = bench.step(150)
    assert not samples(actions)
    assert "no valid posture" in texts(actions)


@pytest.mark.parametrize("moved", [0.05, 0.2])
def test_after_a_gap_the_arm_follows_a_leader_that_has_stayed(moved: float) -> None:
    bench = Bench()
    bench.follow()
    bench.answers = False
    # The samples end, so that the arm rests.
    assert not bench.step(50)
    bench.answers = True
    bench.angle += moved
    assert bool(samples(bench.step(10))) == (moved < 0.09)


def test_person_ends_it() -> None:
    bench = Bench()
    bench.follow()
    bench.step(3)
    bench.values["moving"] = True
    assert "You have ended it." in texts(bench.step(is_asked=True))
    assert not bench.step(20)
    # Others may drive once the arm is at rest.
    bench.values["moving"] = False
    assert bench.step(20) == [ReleaseControl()]


def test_fingers_wait_until_the_jaw_has_met_them() -> None:
    bench = Bench()
    bench.finger = 1.0
    bench.follow()
    assert not [action for action in bench.step(20) if isinstance(action, FingerTarget)]
    grips: list[FingerTarget] = []
    for _ in range(100):
        bench.finger -= 0.01
        grips += [action for action in bench.step() if isinstance(action, FingerTarget)]
    # They move only from where the jaw met them, at most ten times a second.
    assert 3 <= len(grips) <= 10
    assert max(grip.angle for grip in grips) < 0.6
    assert grips[-1].angle < 0.15
