"""Answers that report the outcome of a request."""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import Answer, Numbers

CODES = {
    400: "malformed",
    401: "token_required",
    403: "forbidden",
    404: "not_found",
    405: "method_not_allowed",
    408: "too_slow",
    413: "too_long",
    422: "invalid",
    429: "too_many",
    500: "error",
    503: "not_ready",
}
"""Codes of refusals by their HTTP status; others have that of ``Refused``."""


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """A reason why the arm does not reach the target as it was given.

    Attributes:
        reason: Kind of the finding.
        text: The reason in words.
        amount: Amount in ``unit``; null for a reason without a number.
        unit: Unit of ``amount``.
        axis: Number of the joint, counted from 1.
        parts: The two parts that are about to meet.
    """

    reason: str
    text: str
    amount: float | None = None
    unit: str | None = None
    axis: int | None = None
    parts: tuple[str, str] | None = None


class PartRefusal(msgspec.Struct, frozen=True, kw_only=True):
    """A part of a request that took no effect while other parts did.

    Attributes:
        part: Number of the part, counted from 1 in the order of execution. The joints of a ``set``
            are one part, the first.
        command: Command of the part, for example ``move_object``.
        why: Reason in words.
    """

    part: int
    command: str
    why: str


class MotionEnd(msgspec.Struct, frozen=True, kw_only=True):
    """The end of a motion whose request had ``wait``, and where the arm is then.

    Attributes:
        how: ``reached`` the target; ``limited`` by the findings, as near as the arm can;
            ``contact``, before which it stands; ``paused``; ``stopped``; ``superseded`` by another
            command of the same client; ``lease lost`` to another client; ``timeout``; ``failed``.
        why: Reason in words; empty if the target was reached.
        seconds: Time since the request [s].
        q: (n,) Joint angles that the arm reports [rad]; [m] for joints that slide.
        gripper: Finger joint [rad]; [m] for fingers that slide.
        T: (4, 4) Pose of the tool in the frame {S}; null for a mechanism that has only joints.
    """

    how: str
    why: str
    seconds: float
    q: Numbers
    gripper: float
    T: list[Numbers] | None


class Done(Answer, frozen=True, kw_only=True):
    """The request with this ``id`` is done.

    Attributes:
        ticket: Number of the command. Every state with this or a higher ticket includes it.
        outcome: Outcome of a command. ``accepted``; ``limited`` by the findings, or because the
            parts in ``refused`` take no effect; ``unknown`` if the arm's process does not report
            it within 1 s; ``requested`` for a stop, which later states confirm.
        findings: Reasons for which the command is limited.
        refused: Parts of the request that took no effect.
        rotation_misfit: Largest entry of R^T R - I of the given pose. The nearest rotation is used;
            more than 1e-3 is refused.
        revocations: ``revocations`` of the state in which the command was accepted.
        end: End of the motion, if the request had ``wait``.
    """

    ticket: int | None = None
    outcome: str | None = None
    findings: tuple[Finding, ...] = ()
    refused: tuple[PartRefusal, ...] = ()
    rotation_misfit: float | None = None
    revocations: int | None = None
    end: MotionEnd | None = None


class Refused(Answer, frozen=True, kw_only=True):
    """The request is refused and has changed nothing.

    Attributes:
        why: Reason, and what to do.
        code: Kind of the refusal, for programs: `refused`, or over HTTP the one of its status.
        retry: Time [s] after which the request can be repeated.
        choices: Files of an upload, one of which must be chosen as ``main``.
    """

    why: str
    code: str = "refused"
    retry: float | None = None
    choices: list[str] | None = None

    def with_status(self, status: int) -> Refused:
        """Return the refusal with the code of the HTTP ``status``."""
        return msgspec.structs.replace(self, code=CODES.get(status, self.code))
