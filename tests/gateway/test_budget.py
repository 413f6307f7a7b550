"""Test the processor time that questions may cost, and the accounts that pay."""

from __future__ import annotations

import pytest

from katana450.errors import InputError
from katana450.server.service.budget import (
    IDENTITY_BUDGET,
    MAX_DEBT,
    REQUEST_COST,
    SHARED_BUDGET,
    Budget,
    Budgets,
    BusyError,
)


class Clocks:
    """A clock, and a processor time that advances on request."""

    def __init__(self) -> None:
        self.now = 0.0
        self.used = 0.0

    def budgets(self) -> Budgets:
        return Budgets(lambda: self.now, lambda: self.used)

    def ask(
        self, budget: Budget, seconds: float, driver: str = "", *, question: bool = True
    ) -> None:
        with budget.charged(driver, question=question):
            self.used += seconds


def test_all_windows_of_an_identity_pay_from_one_budget() -> None:
    clocks = Clocks()
    budgets = clocks.budgets()
    clocks.ask(budgets.of("a"), IDENTITY_BUDGET)
    with pytest.raises(BusyError) as refused:
        clocks.ask(budgets.of("a"), 0.0)
    assert refused.value.retry == pytest.approx(0.1)
    assert isinstance(refused.value, InputError)
    assert "Try again in" in str(refused.value)
    clocks.ask(budgets.of("b"), 0.01)
    clocks.now += 1.01
    clocks.ask(budgets.of("a"), 0.0)


def test_retry_time_is_long_enough() -> None:
    clocks = Clocks()
    budget = clocks.budgets().of("a")
    clocks.ask(budget, 3.0 * IDENTITY_BUDGET)
    with pytest.raises(BusyError) as refused:
        clocks.ask(budget, 0.0)
    clocks.now += refused.value.retry + 2.0 * REQUEST_COST / IDENTITY_BUDGET
    clocks.ask(budget, 0.0)


def test_viewers_share_a_budget_and_the_driver_does_not() -> None:
    clocks = Clocks()
    budgets = clocks.budgets()
    viewers = [budgets.of(name) for name in "abc"]
    for viewer in viewers[:2]:
        clocks.ask(viewer, SHARED_BUDGET / 2.0)
    with pytest.raises(BusyError) as refused:
        clocks.ask(viewers[2], 0.0)
    assert not refused.value.gone
    # Other requests than questions do not depend on the shared budget.
    clocks.ask(viewers[2], 0.0, question=False)
    clocks.ask(viewers[2], IDENTITY_BUDGET / 2.0, driver="c/page")
    with pytest.raises(BusyError):
        clocks.ask(viewers[0], 0.0, question=False)


def test_another_window_of_the_driver_cannot_empty_the_drivers_budget() -> None:
    clocks = Clocks()
    budget = clocks.budgets().of("a")
    clocks.ask(budget, 10.0 * IDENTITY_BUDGET)
    for _ in range(50):
        clocks.ask(budget, 0.001, driver="a/page")
    with pytest.raises(BusyError):
        clocks.ask(budget, 0.0)


def test_identity_that_ignores_refusals_is_disconnected_and_later_accepted() -> None:
    clocks = Clocks()
    budget = clocks.budgets().of("a")
    clocks.ask(budget, IDENTITY_BUDGET)
    gone = []
    for _ in range(int(1.1 * MAX_DEBT / REQUEST_COST)):
        with pytest.raises(BusyError) as refused:
            clocks.ask(budget, 0.0)
        gone.append(refused.value.gone)
    assert gone.index(True) == pytest.approx(MAX_DEBT / REQUEST_COST, rel=0.01)
    assert budget.is_exhausted()
    clocks.now += 0.6 * MAX_DEBT / IDENTITY_BUDGET
    assert not budget.is_exhausted()
    clocks.now += 0.5 * MAX_DEBT / IDENTITY_BUDGET
    clocks.ask(budget, 0.0)


def test_budget_is_sufficient_for_several_windows_with_instruments() -> None:
    """Each window requests 30 states and 10 jogs per second, at three times the measured cost."""
    clocks = Clocks()
    budgets = clocks.budgets()
    for tick in range(10 * 30):
        clocks.now = tick / 30.0
        for window in range(4):
            driver = "me/0" if window == 0 else ""
            clocks.ask(budgets.of("me"), 0.0012, driver)
