"""Supervision of an arm by the reports of its driver: what stops it, and where a stopped arm is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from katana450.arm.control.commands.stop_commands import Stop
from katana450.arm.control.state.arm_report import ArmMode, ArmReport
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.arm.control.state.stop_cause import StopCause
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import JointMotion

MAX_TRACKING_ERROR = math.radians(3.0)
"""[rad] Difference of a joint from where it should be above which the arm does not follow."""

MAX_ASTRAY_TIME = 0.3
"""[s] Time for which a tracking error may exceed MAX_TRACKING_ERROR."""

MAX_REPORT_AGE = 0.5
"""[s] Age of a measurement above which the arm counts as lost."""

CONTACT_DISTANCE = 5e-4
"""[m] Measured distance below which parts touch: encoders and calibration leave as much open."""

INTENDED_DISTANCE = 3e-3
"""[m] Distance below which parts are meant to touch, as an object that is picked up or put down and
what it stands on. All other parts are kept 5 mm apart."""


def tracking_error(report: ArmReport, q: FloatArray) -> tuple[float, int]:
    """Return the maximum difference of ``q`` (n,) from where it should be [rad], and its axis."""
    differences = np.abs(q - report.expected[:-1])
    axis = int(differences.argmax())
    return float(differences[axis]), axis


def with_tracking_time(state: State, report: ArmReport) -> State:
    """Return ``state`` with ``report``, and the time since which the arm is astray."""
    error, _ = tracking_error(report, state.q)
    since = None
    if error > MAX_TRACKING_ERROR and report.mode.follows and state.stopped is None:
        since = report.t if state.astray_since is None else state.astray_since
    return replace(state, report=report, astray_since=since)


def unintended_contact(world: CollisionWorld, state: State, report: ArmReport) -> Contact | None:
    """Return the deepest contact at the measured posture that is not meant; None without one.

    Parts are meant to touch if they are near each other where the arm should be.
    """
    placed = world.at(state.x)
    near = placed.nearer_than(CONTACT_DISTANCE)[0].tolist()
    for distance, pair in sorted((placed.distance(pair), pair) for pair in near):
        if distance >= CONTACT_DISTANCE:
            break
        contact = placed.contact(pair)
        if world.gap(report.expected, *contact.parts) >= INTENDED_DISTANCE:
            return contact
    return None


def fault_of(state: State, report: ArmReport, contact: Contact | None) -> Finding | None:
    """Return the reason for which ``state`` must be stopped by ``report``; None without one.

    contact: of two parts that touch at the measured posture and are not meant to; None without one.
    """
    if not report.mode.follows:
        return Finding(Reason.NOT_FOLLOWING)
    age = state.t - report.t
    if age > MAX_REPORT_AGE:
        return Finding(Reason.ARM_SILENT, age)
    if state.astray_since is not None and report.t - state.astray_since > MAX_ASTRAY_TIME:
        return Finding(Reason.TRACKING_ERROR, *tracking_error(report, state.q))
    if contact is not None and state.moving:
        return Finding(Reason.MEASURED_CONTACT, contact.distance, parts=contact.parts)
    return None


def stop_for(state: State, report: ArmReport, world: CollisionWorld | None) -> Stop | None:
    """Return the stop that ``report`` asks for; None without a fault, see ``fault_of``.

    Its cause is a sentence that stays true until the stop is cleared. world: None if contacts are
    not checked.
    """
    contact = None if world is None else unintended_contact(world, state, report)
    fault = fault_of(state, report, contact)
    if fault is None:
        return None
    why = f"{finding_text(fault)}."
    if fault.reason is Reason.NOT_FOLLOWING:
        stays = report.mode in (ArmMode.COLLIDED, ArmMode.FAULT)
        why = report.note if stays and report.note else "The arm was not ready for setpoints."
        if report.mode is ArmMode.LOST:
            why = "The connection to the arm was lost."
    return Stop(StopCause(why), fault)


def held_where_measured(state: State, report: ArmReport) -> State:
    """Return the stopped ``state`` whose setpoint is where the arm was measured.

    The arm itself stays where it came to rest, so no motion follows when the stop is cleared. The
    fingers keep their setpoint while the motors hold them, so that they keep what they hold.
    """
    gripper = state.gripper_setpoint if report.mode.follows else state.gripper
    if not np.array_equal(state.setpoint, state.q):
        q = frozen(state.q)
        state = replace(state, motion=JointMotion.rest(q), goal=q)
    findings = tuple(
        replace(other, amount=0.0, time=0.0) if other.reason is Reason.STOPPED else other
        for other in state.findings
        if other.reason is not Reason.MEASURED_STOP
        and not (report.mode.follows and other.reason is Reason.NOT_FOLLOWING)
    )
    if report.measured_stop is not None and report.mode is ArmMode.HOLDING:
        measured = report.measured_stop
        finding = Finding(Reason.MEASURED_STOP, measured.angle, time=measured.time)
        findings = (findings[0], finding, *findings[1:]) if findings else (finding,)
    if not report.mode.follows and all(f.reason is not Reason.NOT_FOLLOWING for f in findings):
        findings = (*findings, Finding(Reason.NOT_FOLLOWING))
    return replace(
        state, gripper_setpoint=gripper, gripper_goal=gripper, mode=IDLE, findings=findings
    )
