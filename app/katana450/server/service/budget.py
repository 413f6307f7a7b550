"""Processor time that questions may take, so that answering them never delays STOP.

An answer costs the time of its computation, and a fixed amount for its transfer. All sockets and
HTTP requests of one identity pay from one account. All clients that do not drive also pay from a
shared account. The driver pays from a separate account, which no other client can empty.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from katana450.errors import InputError
from katana450.server.service.limits import SenderBuckets, TokenBucket

IDENTITY_BUDGET = 0.25
"""Budget of one identity, and of the driver [s of processor time per second]."""

SHARED_BUDGET = 0.5
"""Budget of all clients that do not drive, together [s of processor time per second]."""

REQUEST_COST = 2e-4
"""Fixed cost of a request on a socket [s]: to read and decode it, and to send the answer."""

HTTP_REQUEST_COST = 5e-4
"""Fixed cost of a request over HTTP [s]."""

MAX_DEBT = 1.0
"""Maximum debt of an identity [s of processor time]; at this debt the client is disconnected. Its
programs may connect again once half of the debt is paid."""

MAX_ACCOUNTS = 1024
"""Maximum number of identities whose accounts are kept."""


class BusyError(InputError):
    """Raised for a request beyond the budget.

    Attributes:
        retry: Time after which to try again [s].
        gone: Whether the debt is so large that the client must be disconnected.
    """

    def __init__(self, wait: float, *, disconnects: bool = False) -> None:
        retry = math.ceil(10.0 * wait) / 10.0
        super().__init__(
            "Your windows and programs together, or all viewers together, send too many requests. "
            f"Try again in {retry:.1f} s, and less often."
        )
        self.retry = retry
        self.gone = disconnects


class Budgets:
    """Accounts of each identity, of the driver, and of all others together."""

    def __init__(
        self, clock: Callable[[], float], processor: Callable[[], float] = time.thread_time
    ) -> None:
        """Create full accounts. ``processor``: processor time of this thread alone [s]."""
        self.clock = clock
        self.processor = processor
        self._shared = TokenBucket(SHARED_BUDGET, SHARED_BUDGET, clock(), MAX_DEBT)
        own = IDENTITY_BUDGET, IDENTITY_BUDGET
        self._identities = SenderBuckets(*own, MAX_ACCOUNTS, debt=MAX_DEBT)
        self._drivers = SenderBuckets(*own, 1, debt=MAX_DEBT)

    def of(self, identity: str) -> Budget:
        """Return the budget of ``identity``."""
        return Budget(self, identity)

    def accounts(self, identity: str, driver: str, *, question: bool) -> tuple[TokenBucket, ...]:
        """Return the accounts that pay, the client's own first; see ``Budget.charged``."""
        if driver:
            # Another driver gets another account.
            return (self._drivers.bucket_of(driver, self.clock()),)
        own = self._identities.bucket_of(identity, self.clock())
        return (own, self._shared) if question else (own,)


class Budget:
    """Budget of one identity, on all its connections together."""

    def __init__(self, budgets: Budgets, identity: str) -> None:
        self._budgets = budgets
        self._identity = identity

    @contextmanager
    def charged(
        self, driver: str = "", *, question: bool = True, fixed: float = REQUEST_COST
    ) -> Iterator[None]:
        """Charge the processor time of the ``with`` block to the budget.

        ``driver``: key of the participant that asks if it drives; else empty. ``question``: whether
        the shared account of all clients that do not drive pays too. ``fixed``: cost in addition
        to the block itself [s]. Raises BusyError, which costs ``fixed``, when an account is empty.
        """
        t, processor = self._budgets.clock(), self._budgets.processor
        accounts = self._budgets.accounts(self._identity, driver, question=question)
        wait = max(account.wait(t) for account in accounts)
        if wait > 0.0:
            # A refusal takes time too, but the shared account does not pay for it.
            accounts[0].spend(fixed)
            raise BusyError(wait, disconnects=accounts[0].left(t) <= -MAX_DEBT)
        began = processor()
        try:
            yield
        finally:
            cost = fixed + processor() - began
            for account in accounts:
                account.spend(cost)

    def is_exhausted(self) -> bool:
        """Return whether the debt is more than half of ``MAX_DEBT``."""
        (own,) = self._budgets.accounts(self._identity, "", question=False)
        return own.left(self._budgets.clock()) <= -MAX_DEBT / 2.0
