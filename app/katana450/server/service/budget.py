"""Processor time that questions may take, so that answering them never keeps STOP waiting.

An answer costs what it takes to work out, and a fixed sum for its way in and out. All sockets and
HTTP requests of one identity pay from one account, and everybody who does not drive from a common
one besides. Whoever drives pays from an account of their own, which nobody else can empty.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from katana450.errors import InputError

IDENTITY_BUDGET = 0.25
"""[s of processor time a second] Of one identity, and of whoever drives."""

SHARED_BUDGET = 0.5
"""[s of processor time a second] Of all who do not drive together."""

REQUEST_COST = 2e-4
"""[s] That any request on a socket costs: to read and decode it, and to send the answer."""

HTTP_REQUEST_COST = 5e-4
"""[s] That one over HTTP costs."""

MAX_DEBT = 1.0
"""[s of processor time] Beyond its budget, an identity that asks on regardless is sent away. Its
programs may come again once half of it is made good."""

MAX_ACCOUNTS = 1024
"""Identities that are remembered."""


class BusyError(InputError):
    """More was asked than the budget allows. retry: how long to wait [s]; gone: far too much."""

    def __init__(self, wait: float, *, gone: bool = False) -> None:
        retry = math.ceil(10.0 * wait) / 10.0
        super().__init__(
            "Too much is asked at once by your windows and programs together, or by all who watch. "
            f"Ask again in {retry:.1f} s, and less often."
        )
        self.retry = retry
        self.gone = gone


class _Account:
    """Seconds that come back with time. They may fall below zero: a cost is known afterwards."""

    def __init__(self, rate: float, t: float) -> None:
        self._rate = rate
        self._left = rate
        self._t = t

    def left(self, t: float) -> float:
        """What there is at time ``t`` [s]; at most what comes in a second."""
        self._left = min(self._rate, self._left + self._rate * max(t - self._t, 0.0))
        self._t = max(t, self._t)
        return self._left

    def pay(self, cost: float) -> None:
        """Take ``cost`` away; a debt is never more than DEBT."""
        self._left = max(self._left - cost, -MAX_DEBT)

    def wait(self, t: float) -> float:
        """[s] Until there is something left again; 0 while there is."""
        return max(-self.left(t), 0.0) / self._rate


class Budgets:
    """One for each identity, one for whoever drives, one for all others together."""

    def __init__(
        self, clock: Callable[[], float], processor: Callable[[], float] = time.thread_time
    ) -> None:
        """``processor``: time [s] that this thread has used, and no other."""
        self.clock = clock
        self.processor = processor
        self._crowd = _Account(SHARED_BUDGET, clock())
        self._driver = ("", _Account(IDENTITY_BUDGET, clock()))
        self._known: dict[str, _Account] = {}

    def of(self, identity: str) -> Budget:
        """That of ``identity``."""
        return Budget(self, identity)

    def accounts(self, identity: str, driver: str, *, question: bool) -> tuple[_Account, ...]:
        """Who pays, the first on their own account; see ``Budget.charged``."""
        if driver:
            if self._driver[0] != driver:
                self._driver = (driver, _Account(IDENTITY_BUDGET, self.clock()))
            return (self._driver[1],)
        # The one that was used last stands last.
        own = self._known.pop(identity, None) or _Account(IDENTITY_BUDGET, self.clock())
        self._known[identity] = own
        while len(self._known) > MAX_ACCOUNTS:
            self._known.pop(next(iter(self._known)))
        return (own, self._crowd) if question else (own,)


class Budget:
    """That of one identity, whatever it asks on."""

    def __init__(self, budgets: Budgets, identity: str) -> None:
        self._budgets = budgets
        self._identity = identity

    @contextmanager
    def charged(
        self, driver: str = "", *, question: bool = True, fixed: float = REQUEST_COST
    ) -> Iterator[None]:
        """Do something, and take from the budget what it cost.

        ``driver``: the key of the window that asks, if it is the one that drives. ``question``:
        whether it takes from what is common to all who do not drive, too. ``fixed``: cost
        besides the work itself [s]. Raises BusyError, at this cost, when nothing is left.
        """
        t, processor = self._budgets.clock(), self._budgets.processor
        accounts = self._budgets.accounts(self._identity, driver, question=question)
        wait = max(account.wait(t) for account in accounts)
        if wait > 0.0:
            # What is refused takes time as well; the crowd is not made to pay for it.
            accounts[0].pay(fixed)
            raise BusyError(wait, gone=accounts[0].left(t) <= -MAX_DEBT)
        began = processor()
        try:
            yield
        finally:
            cost = fixed + processor() - began
            for account in accounts:
                account.pay(cost)

    def is_exhausted(self) -> bool:
        """Whether far more was asked of late than there is time for."""
        (own,) = self._budgets.accounts(self._identity, "", question=False)
        return own.left(self._budgets.clock()) <= -MAX_DEBT / 2.0
