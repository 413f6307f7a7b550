"""Answers that report the outcome of a request."""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import Answer


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """One reason why the arm does not do what was wished.

    ``said`` in words; ``amount`` in ``unit``, both null when there is none; ``axis`` counts from 1;
    ``parts``: the two that are about to meet; ``seconds``: how long a stop takes.
    """

    reason: str
    said: str
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
    """The request of that id is done. A command of the arm has a ``ticket``: it is in every state
    whose ticket is no smaller. Its ``outcome``: accepted, limited by the ``findings`` or because
    the parts in ``refused`` take no effect, or unknown if the arm's process does not report it
    within 1 s; of a stop, requested: the state tells when it is confirmed. ``rotation_misfit``, of
    a pose: the largest entry of R^T R - I; the nearest rotation is used, and more than 1e-3 is
    refused. ``revocations``: the state's, when the command was accepted."""

    ticket: int | None = None
    outcome: str | None = None
    findings: tuple[Finding, ...] = ()
    refused: tuple[PartRefusal, ...] = ()
    rotation_misfit: float | None = None
    revocations: int | None = None


class Refused(Answer, frozen=True, kw_only=True):
    """Nothing has changed; ``why`` says why and what to do. ``retry`` [s]: ask again then."""

    why: str
    retry: float | None = None
