"""Plans cross the pipe once, and return as the same plan."""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import Following
from katana450.arm.control.state.solid import Solid
from katana450.arm.runtime.pipes.state_publisher import Snapshot
from katana450.arm.runtime.pipes.wire import MAX_NAMED_PLANS, PlanNames, PlanStore
from katana450.maths.planning.plan import Plan


@pytest.fixture(scope="module")
def plan(arm: ArmModel) -> Plan:
    session = Session(arm, np.array((0.0, -1.2, 1.5, 0.1, 0.0)))
    state = session.begin(session.ready, 0.0, 0.0)
    return plan_to(arm, None, state, session.ready + 0.2)


def test_plan_returns_as_the_same_object(plan: Plan) -> None:
    names, plans = PlanNames(), PlanStore()
    plans.note(7, plan)
    over_there: Plan = pickle.loads(pickle.dumps(plan))
    names.note(7, over_there)
    data = names.dumped(Following.begin(over_there))
    back = plans.loaded(data)
    assert back.plan is plan
    assert len(data) < 2000 < len(pickle.dumps(Following.begin(over_there)))


def test_unknown_plan_is_sent_completely(plan: Plan) -> None:
    back = PlanStore().loaded(PlanNames().dumped(plan))
    assert np.array_equal(back.end, plan.end)


class _InterruptedPickler(pickle.Pickler):
    """Pickles a value as if another thread read its properties meanwhile."""

    def __init__(self, read: Callable[[], object]) -> None:
        super().__init__(io.BytesIO())
        self._read, self._values = read, 0

    def persistent_id(self, _value: object) -> None:
        self._values += 1
        if self._values == 10:
            self._read()


def test_property_may_be_read_first_while_its_object_is_pickled(arm: ArmModel, plan: Plan) -> None:
    session = Session(arm, np.array((0.0, -1.2, 1.5, 0.1, 0.0)))
    state = session.begin(session.ready, 0.0, 0.0)
    _InterruptedPickler(lambda: (state.moving, state.under_way)).dump(state)
    assert {"moving", "under_way"} <= vars(state).keys()
    whole = replace(plan)
    _InterruptedPickler(lambda: (whole.begins, whole.start, whole.end)).dump(whole)
    segment = replace(plan.segments[0])
    _InterruptedPickler(lambda: (segment.length, segment.sweep)).dump(segment)
    assert {"length", "sweep"} <= vars(segment).keys()


def test_published_state_is_complete(arm: ArmModel) -> None:
    session = Session(arm, np.array((0.0, -1.2, 1.5, 0.1, 0.0)))
    snapshot = Snapshot(session.begin(session.ready, 0.0, 0.0), 0)
    assert {"moving", "under_way"} <= vars(snapshot.state).keys()


def test_old_plans_are_forgotten(plan: Plan) -> None:
    names, plans = PlanNames(), PlanStore()
    copies = [pickle.loads(pickle.dumps(plan)) for _ in range(MAX_NAMED_PLANS + 1)]
    for number, one in enumerate(copies):
        plans.note(number, one)
        names.note(number, one)
    assert plans.loaded(names.dumped(copies[-1])) is copies[-1]
    assert plans.loaded(names.dumped(copies[0])) is not copies[0]


def solid(key: str) -> Solid:
    return Solid(key, (1.0, 1.0, 1.0), np.random.default_rng(1).normal(size=(64, 3)))


def test_solid_is_sent_completely_once_and_then_as_its_key() -> None:
    names, plans = PlanNames(), PlanStore()
    one, other = solid("one"), solid("other")
    first = plans.loaded(names.dumped([one, other, one]))
    assert [person.key for person in first] == ["one", "other", "one"]
    assert first[0] is first[2]
    np.testing.assert_array_equal(first[1].corners, other.corners)
    data = names.dumped([other, one])
    assert len(data) < 200 < len(pickle.dumps(one))
    again = plans.loaded(data)
    assert again == [first[1], first[0]]
    # A solid that was absent is sent completely again, so that both memories stay bounded.
    plans.loaded(names.dumped([one]))
    (back,) = plans.loaded(names.dumped([other]))
    np.testing.assert_array_equal(back.corners, other.corners)
    assert back.size == other.size
