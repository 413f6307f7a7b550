"""Answers that report the outcome of a request."""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import Answer


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """A reason why the arm does not reach the target as it was given.

    ``text``: the reason in words. ``amount`` in ``unit``: both null where there is no number.
    ``axis`` counts from 1. ``parts``: the two parts that are about to meet. ``seconds``: duration
    of a stop.
    """

    reason: str
    text: str
    amount: float | None = None
    unit: str | None = None
    axis: int | None = None
    parts: tuple[str, str] | None = None
    seconds: float | None = None


class PartRefusal(msgspec.Struct, frozen=True, kw_only=True):
    """A part of a request that took no effect while others did, and why.

    ``part`` counts from 1 in the order of execution: the joints of a ``set`` are one part, the
    first. ``command``: what it is for the arm, for example ``shift`` for an object.
    """

    part: int
    command: str
    why: str


class Done(Answer, frozen=True, kw_only=True):
    """The request of that id is done.

    Attributes:
        ticket: of a command of the arm: every state with this or a higher ticket includes it.
        outcome: accepted; limited by the ``findings``, or because the parts in ``refused`` take no
            effect; unknown if the arm's process does not report it within 1 s; for a stop,
            requested: the state tells when it is confirmed.
        rotation_misfit: of a pose: the largest entry of R^T R - I. The nearest rotation is used;
            more than 1e-3 is refused.
        revocations: the state's number when the command was accepted.
    """

    ticket: int | None = None
    outcome: str | None = None
    findings: tuple[Finding, ...] = ()
    refused: tuple[PartRefusal, ...] = ()
    rotation_misfit: float | None = None
    revocations: int | None = None


class Refused(Answer, frozen=True, kw_only=True):
    """The request is refused and has changed nothing. ``why``: the reason, and what to do.
    ``retry``: time [s] after which to ask again.
    """

    why: str
    retry: float | None = None
