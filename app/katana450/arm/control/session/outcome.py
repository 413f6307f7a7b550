"""Outcome of a command: whether the session accepted, limited or refused it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.goals import may_offer, without_finding
from katana450.arm.control.session.stopping import clear_refusal
from katana450.arm.control.session.transitions import Effect, effect_of
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.scene_objects import MAX_OBJECTS, named
from katana450.arm.control.state.state import (
    ACCEPTED,
    CAUSES,
    Outcome,
    PartRefusal,
    Reason,
    State,
    Verdict,
)

INTENDED_REASONS = (Reason.STOPPED, Reason.PAUSED, Reason.WAITING, *CAUSES)
"""Reasons that are the purpose of a command, and limit nothing."""

NO_DETOUR = "No detour is offered: drag the tool to a target that the arm cannot follow, and wait."
"""Refusal of ``Go`` without an offer."""


def refused(why: str) -> Outcome:
    """Return the outcome of a command that takes no effect, for the reason ``why``."""
    return Outcome(Verdict.REFUSED, why=why)


DROPPED = refused("The arm was stopped before it took effect. Clear the stop, then send it again.")
"""Outcome of a command that waited when a stop came."""

FAILED = refused("An internal error stopped it: the arm holds. See the log of the server.")
"""Outcome of a command in a tick that failed."""


def take_all(
    take: Callable[[State, cmd.Command], State], state: State, command: cmd.Command
) -> tuple[State, Outcome]:
    """Return ``take(state, command)`` and its outcome; ``state`` itself if it is refused.

    The parts of a batch are taken one after another.
    """
    if not isinstance(command, cmd.Batch):
        why = refusal(state, command)
        if why:
            return state, refused(why)
        after = take(state, command)
        command_outcome = outcome(state, after)
        if command_outcome.verdict is Verdict.REFUSED:
            # A plan that begins elsewhere. It leaves no trace but the finding that says so.
            others = without_finding(state, Reason.NOT_AT_START).findings
            after = replace(state, findings=(*others, *command_outcome.findings))
        return after, command_outcome
    outcomes = []
    for part in command.commands:
        state, part_outcome = take_all(take, state, part)
        outcomes.append(part_outcome)
    return state, _merged(command, outcomes)


def refusal(state: State, command: cmd.Command) -> str:
    """Return why ``command`` takes no effect in ``state``; an empty text if it does."""
    if effect_of(command, state) is Effect.REFUSED:
        return _why_refused(state, command)
    match command:
        case cmd.ClearStop(known=newest, t=t):
            return clear_refusal(state, max(t, state.t), newest)
        case cmd.OperateArm() if state.report is None:
            return "This arm is simulated: it has no connection, calibration or motors to operate."
        case cmd.OperateArm() if state.stopped is None or state.moving:
            return "Stop the arm first, and wait until it is at rest."
        case cmd.OperateArm(act=act) if state.report and act not in state.report.mode.acts:
            now = state.report.mode.value
            return f"{act.value.capitalize()} is not possible while the arm is {now}."
        case cmd.Go() if state.detour is None:
            return NO_DETOUR
        case cmd.OfferDetour(plan=plan) if not may_offer(state, plan):
            return "The detour belongs to another state of the arm."
        case cmd.PlaceObject(scene_object=scene_object):
            known = named(state.objects, scene_object.name)
            if known is None and len(state.objects) >= MAX_OBJECTS:
                return f"There are {MAX_OBJECTS} objects already: remove one first."
            return _held(state, scene_object.name)
        case cmd.Remove(name=name) | cmd.MoveObject(name=name) | cmd.Attach(name=name):
            if named(state.objects, name) is None:
                return f"There is no {name!r}."
            return _held(state, name)
    return ""


def _why_refused(state: State, command: cmd.Command) -> str:
    if state.stopped is not None and not command.traits.while_stopped:
        return "The arm is stopped: clear the stop first."
    if state.paused and not command.traits.while_paused:
        return "The arm is paused: resume first."
    match command:
        case cmd.Go() | cmd.OfferDetour():
            return NO_DETOUR
        case cmd.GoAlong():
            return "The arm follows no plan: send a plan first."
        case cmd.EndDrag():
            return "There is no drag to end: another command has ended it."
    return f"{type(command).__name__} is not possible in this mode."


def outcome(before: State, after: State) -> Outcome:
    """Return the outcome of a command that took ``before`` to ``after``."""
    findings = tuple(
        finding
        for finding in after.findings
        if finding.reason not in INTENDED_REASONS
        and not any(finding is known for known in before.findings)
    )
    if any(finding.reason is Reason.NOT_AT_START for finding in findings):
        return Outcome(Verdict.REFUSED, findings)
    return Outcome(Verdict.LIMITED, findings) if findings else ACCEPTED


def _held(state: State, name: str) -> str:
    scene_object = named(state.objects, name)
    if scene_object is None or not scene_object.held:
        return ""
    return f"The gripper holds {name!r}: open it first."


def reason(refusal: Outcome) -> str:
    """Return the reason of a refusal in words."""
    return refusal.why or "; ".join(finding_text(finding) for finding in refusal.findings) + "."


def _merged(batch: cmd.Batch, outcomes: list[Outcome]) -> Outcome:
    """Return the outcome of ``batch`` by those of its parts: refused if all are."""
    findings = tuple(finding for combined in outcomes for finding in combined.findings)
    refusals = tuple(
        PartRefusal(part, type(command).__name__, reason(combined))
        for part, (command, combined) in enumerate(zip(batch.commands, outcomes, strict=True))
        if combined.verdict is Verdict.REFUSED
    )
    if refusals and len(refusals) == len(outcomes):
        why = " ".join(dict.fromkeys(combined.why for combined in refusals))
        return Outcome(Verdict.REFUSED, findings, why, refusals)
    limited = refusals or findings
    return Outcome(Verdict.LIMITED, findings, refused=refusals) if limited else ACCEPTED
