"""Status of the arm and of the lease, as a page shows it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from katana450.arm.control.lease import Person
from katana450.arm.control.session.supervision import tracking_error
from katana450.arm.control.state.arm_report import ArmMode, ArmReport
from katana450.arm.control.state.messages import headline, mood, overlap_text, part, sentence
from katana450.arm.control.state.state import State, Status
from katana450.arm.runtime.pipes.stop_messages import NO_STATE
from katana450.maths.collision.clearance import DEPTH_ROUNDING
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant, addressed
from katana450.server.service.runner import StatusLine

FIRST = (Status.FAULT, Status.STOPPED, Status.BLOCKED)
"""States of the arm that have priority over the status of a runner."""

UNCONTROLLED: Mapping[ArmMode | None, tuple[StatusLine, str]] = {
    ArmMode.CALIBRATING: (
        StatusLine("stopped", "Calibrating", "The arm moves by itself."),
        "STOP ends the calibration.",
    ),
    ArmMode.LOST: (
        StatusLine("stopped", "Arm lost", "It may still move."),
        "If it moves, use its switch.",
    ),
}
"""State line of a stopped arm that may move nevertheless, and the sentence on the stop."""

MIN_SHOWN_AGE = 0.2
"""Minimum age of a picture [s] that the page shows."""

SHOWN_CLEARANCE = 0.03
"""Distance [m] of the two nearest parts below which the page shows it."""


def silence(hub: Hub) -> float | None:
    """Return the time since the arm's process last answered [s]; None up to ``NO_STATE``."""
    age = 0.0 if hub.arm is None else hub.arm.age
    return age if age > NO_STATE else None


def health(hub: Hub) -> str | None:
    """Return what is wrong with the server, in words; None if nothing is."""
    if hub.arm is None:
        return "The arm is not ready yet."
    age = silence(hub)
    if age is not None:
        return f"No answer from the arm's process for {age:.1f} s."
    episodes = hub.shown.get("episodes") or {}
    unwritten = hub.recorder.problem or episodes.get("problem")
    return hub.stop_path.problem or unwritten or None


def state_line(hub: Hub, reader: Person | None = None) -> StatusLine:
    """Return the state line, in which ``reader`` is "you"."""
    state = hub.arm.state if hub.arm is not None else None
    stopped, age = hub.stopped, silence(hub)
    now = StatusLine("starting", "Starting", "")
    if state is not None:
        now = StatusLine(mood(state), headline(state), sentence(state))
        nearest = hub.arm.nearest if hub.arm is not None and state.status is Status.OK else None
        if nearest is not None and nearest.distance < -DEPTH_ROUNDING:
            now = StatusLine("limited", "Overlap", overlap_text(*nearest.parts, nearest.distance))
        rests = not (state.moving or state.paused or hub.runner.running)
        if hub.arm is not None and hub.arm.busy and rests:
            now = StatusLine("planning", "Planning a path", "The arm then follows it.")
        elif hub.arm is not None and hub.arm.planning_failure and rests:
            why = f"{hub.arm.planning_failure} {now.why}".rstrip()
            now = StatusLine("limited", "No path found", why)
        if state.status not in FIRST:
            now = hub.runner.status_line(state, now, reader)
    if stopped is not None:
        rests = stopped.confirmed and not (state is not None and state.moving)
        now = StatusLine("stopped", "Stopped" if rests else "Stopping…", "")
        if (mode := arm_mode(hub)) in UNCONTROLLED:
            now = UNCONTROLLED[mode][0]
    if age is not None:
        now = StatusLine("lost", "No answer from the arm", f"The state shown is {age:.1f} s old.")
    if stopped is not None and not stopped.confirmed:
        why = f"The arm has not confirmed the stop. {now.why}".rstrip()
        now = StatusLine("stopped", "Stopping…" if age is None else "Stop requested", why)
    return now


def arm_mode(hub: Hub) -> ArmMode | None:
    """Return the mode of a real arm; None for another one."""
    report = None if hub.arm is None else hub.arm.state.report
    return None if report is None else report.mode


def arm_status(state: State, report: ArmReport) -> dict[str, Any]:
    """Return what a page shows of a real arm, with angles in degrees."""
    stop = report.measured_stop
    return {
        "mode": report.mode.value,
        "note": report.note,
        "acts": {act.value: act.hazard for act in report.mode.acts},
        "lag": round(math.degrees(float(np.abs(state.setpoint - state.q).max())), 1),
        "error": round(math.degrees(tracking_error(report, state.q)[0]), 1),
        "age": round(state.t - report.t, 2),
        "round_trip": round(report.round_trip, 3),
        "stop": None if stop is None else (stop.time, math.degrees(stop.angle), stop.distance),
    }


def clearance(hub: Hub) -> dict[str, Any] | None:
    """Return what a page shows of the two nearest parts; None if they are not near each other.

    The distance is in mm, the points are in the base frame [m].
    """
    nearest = None if hub.arm is None else hub.arm.nearest
    if nearest is None or nearest.distance > SHOWN_CLEARANCE:
        return None
    return {
        "distance": round(1e3 * nearest.distance, 1),
        "parts": [part(name) for name in nearest.parts],
        "points": nearest.points.round(4).tolist(),
    }


def pace_refusal(hub: Hub, participant: Participant) -> str:
    """Return why ``participant`` may not pause, resume or slow down the arm; empty if allowed."""
    driver, program, person = hub.lease.driver, hub.gate.program, participant.person
    if not person.role.may_drive:
        return "You may watch, not drive."
    if driver is None or driver == person:
        return ""
    if program is not None and program.person == driver and hub.runner.orders(participant):
        return ""
    return f"{driver.name} drives: ask for the arm."


def common(hub: Hub) -> dict[str, Any]:
    """Return the part of the status that is the same for all pages."""
    state = hub.arm.state if hub.arm is not None else None
    stopped, holder = hub.stopped, hub.lease.driver
    return {
        **state_line(hub)._asdict(),
        "stop": None if stopped is None else stopped.stage,
        "stopped": None if stopped is None else stopped.why,
        "stopped_at": None if stopped is None else stopped.cause.at or None,
        "wait": hub.gate.clear_refusal,
        "problem": hub.stop_path.problem or hub.recorder.problem,
        "holder": None if holder is None else holder.name,
        "silence_profile": "" if hub.arm is None else hub.arm.profile.value,
        "speed": 1.0 if state is None else state.speed,
        "step_speed": hub.runner.sets_speed,
        "paused": state is not None and state.paused,
        "arm": None if state is None or state.report is None else arm_status(state, state.report),
        "clearance": clearance(hub),
        "participants": len(hub.participants),
        "revocations": hub.gate.revocations,
        # A robot without a tool has only joints, which scripts do not move.
        "scripts": bool(hub.runner.request_types) and state is not None and state.tool != "",
        **hub.shown,
    }


def orders(hub: Hub, participant: Participant) -> dict[str, Any]:
    """Return the orders that the page of ``participant`` offers, and what they are about."""
    program, takeover = hub.runner.progress(), hub.gate.takeover_by(participant.person)
    offered = list(hub.runner.orders(participant)) if hub.arm is not None else []
    about = [program.name, program.step, program.steps] if program is not None else []
    entries: dict[str, Any] = {"orders": offered, "continues": about}
    if takeover is None or hub.arm is None or hub.stopped is not None or "end" in offered:
        return entries
    if hub.participant(takeover.driver.key) is not None:
        entries = {"orders": ["continue"], "continues": [takeover.driver.name, 0, 0]}
    entries["orders"] += ["rewind"] if hub.arm.state.report is None else []
    entries["orders"] += ["keep"] if hub.shown.get("episodes") else []
    return {**entries, "driven_since": takeover.since}


def of(hub: Hub, participant: Participant) -> dict[str, Any]:
    """Return the part of the status that is for ``participant`` alone."""
    person, lease = participant.person, hub.lease
    mine = lease.holder == person
    # While a program drives, its owner decides on requests for the lease.
    decides = hub.giver(participant) == lease.holder
    program = hub.runner.progress()
    planning = program is not None and program.status == "planning"
    age = hub.pictures.age(participant.person.key, hub.clock())
    stopped = hub.stopped
    own_stop = None if stopped is None or stopped.cause.key != person.key else stopped.why
    clears = hub.gate.may_clear(person)
    clearer = "an operator" if lease.driver is None else lease.driver.name
    stays = "Press Clear stop to continue." if clears else f"{clearer} can clear the stop."
    if (mode := arm_mode(hub)) in UNCONTROLLED:
        stays = UNCONTROLLED[mode][1]
    return {
        **(state_line(hub, person)._asdict() if hub.runner.names(person) else {}),
        **({"stopped": addressed(own_stop, person.name)} if own_stop else {}),
        "pace": pace_refusal(hub, participant),
        "may_clear_stop": clears,
        "until": "" if stopped is None else stays,
        "name": person.name,
        "role": person.role.value,
        "mine": mine,
        "own_program": decides and not mine,
        "asked": person in lease.waiting,
        "asking": [
            {"number": other.number, "name": other.person.name}
            for other in hub.participants
            if decides and other.person in lease.waiting
        ],
        "others": [
            {"number": other.number, "name": other.person.name}
            for other in hub.participants
            if mine and other.person != person and other.person.role.may_drive
        ],
        "planning": planning,
        "fraction": round(program.fraction, 2) if program is not None and planning else 0.0,
        **orders(hub, participant),
        "age": round(age, 1) if age >= MIN_SHOWN_AGE else 0,
        **{
            key: value
            for handler in hub.handlers
            for key, value in handler.page_status(participant).items()
        },
    }
