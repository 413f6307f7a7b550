"""Conversion of states, findings, objects and other values into API answers, once a snapshot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import msgspec

from katana450.arm.control.commands.act import tag_of
from katana450.arm.control.objects.environment import Hand
from katana450.arm.control.objects.grip import FINGER_FORCE, finger_forces, touching
from katana450.arm.control.objects.pouring import Pouring
from katana450.arm.control.session.checks import reason
from katana450.arm.control.session.tool_targets import BranchOption
from katana450.arm.control.state import state as control
from katana450.arm.control.state.arm_report import ArmReport
from katana450.arm.control.state.findings import Margins
from katana450.arm.control.state.messages import finding_text, sentence
from katana450.arm.control.state.solid import Colour
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.pipes.state_publisher import LoopTiming, Snapshot
from katana450.maths.kinematics.forward import forward
from katana450.maths.water.units import MILLILITRE
from katana450.server.api import answers
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import Hub

UNITS = {
    control.Reason.STOPPED: "m",
    control.Reason.CONTACT: "m",
    control.Reason.ACROSS_GAP: "rad",
    control.Reason.OUT_OF_REACH: "m",
    control.Reason.POSITION_CHANGED: "m",
    control.Reason.AXIS_LIMIT: "rad",
    control.Reason.SLIDE_LIMIT: "m",
    control.Reason.GRIPPER_LIMIT: "rad",
    control.Reason.GRIPPER_SLIDE_LIMIT: "m",
    control.Reason.YAW_FIXED: "rad",
    control.Reason.PITCH_CHANGED: "rad",
    control.Reason.ROLL_CHANGED: "rad",
    control.Reason.LOPSIDED: "m",
    control.Reason.LEAKING: "m",
    control.Reason.SLIDING: "N",
    control.Reason.SLIPPED: "N",
    control.Reason.CRUSHED: "N",
    control.Reason.NOT_AT_START: "rad",
    control.Reason.SLOW_ZONE: "m/s",
}
"""Units of the amounts; the other reasons have no amount."""

T = TypeVar("T")

NO_TOOL = dict.fromkeys(
    ("tool", "T", "pitch", "roll", "tool_speed", "margins", "branch", "priority"), None
)
"""Fields of a state about the tool, for a robot that has only joints."""

_FOUND: WeakKeyDictionary[Snapshot, dict[str, Any]] = WeakKeyDictionary()
"""Values by snapshot and name, dropped with the snapshot. For the gateway's thread alone."""


def finding(cause: control.Finding) -> answers.Finding:
    """Return a finding as a part of an answer, in SI units."""
    unit = UNITS.get(cause.reason)
    return answers.Finding(
        reason=cause.reason.value,
        text=finding_text(cause),
        amount=None if unit is None else cause.amount,
        unit=unit,
        axis=None if cause.axis is None else cause.axis + 1,
        parts=cause.parts,
    )


def concluded(done: answers.Done, outcome: control.Outcome) -> answers.Done | answers.Refused:
    """Return ``done`` with the outcome of its command; ``Refused`` for a refused command."""
    if outcome.verdict is control.Verdict.REFUSED:
        return answers.Refused(id=done.id, why=reason(outcome))
    return msgspec.structs.replace(
        done,
        outcome=outcome.verdict.value,
        findings=tuple(finding(cause) for cause in outcome.findings),
        refused=tuple(
            answers.PartRefusal(part=part.part + 1, command=tag_of(part.command), why=part.why)
            for part in outcome.refused
        ),
    )


def motion_end(arm: ArmHandle, how: str, why: str, seconds: float) -> answers.MotionEnd:
    """Return the end of a motion with the place of the arm; see ``answers.MotionEnd``."""
    now, robot = arm.state, arm.robot
    T = None if robot.arm is None else forward(robot.arm.chain_to(now.tool), now.q).tolist()
    return answers.MotionEnd(
        how=how, why=why, seconds=seconds, q=now.q.tolist(), gripper=now.gripper, T=T
    )


def state(hub: Hub) -> answers.State:
    """Return the newest state. Raises LeaseError until there is an arm."""
    arm = hub.present()
    snapshot, holder, stopped = arm.snapshot, hub.lease.driver, hub.stopped
    fields = once(snapshot, "state", lambda: _of_snapshot(arm, snapshot))
    # A failed planning is read last: it is known before the arm is no longer busy.
    moving = snapshot.state.moving or arm.busy
    why = " ".join(filter(None, (arm.planning_failure, fields["why"])))
    return answers.State(
        **(fields | {"why": why}),
        sent=hub.clock(),
        moving=moving,
        holder=None if holder is None else holder.name,
        stopped=None if stopped is None else stopped.why,
        stop=None if stopped is None else stopped.stage,
        stopped_at=None if stopped is None else stopped.cause.at or None,
        clearable=stopped is not None and not hub.gate.clear_refusal,
        revocations=hub.gate.revocations,
        age=arm.age,
        participants=len(hub.participants),
        program=hub.runner.progress(),
    )


def _of_snapshot(arm: ArmHandle, snapshot: Snapshot) -> dict[str, Any]:
    """Return the fields of a state that depend on ``snapshot`` alone."""
    now, mounted = snapshot.state, arm.robot.arm
    hand = arm.environment.hand
    return {
        "t": now.t,
        "ticket": snapshot.ticket,
        "q": now.q.tolist(),
        "setpoint": now.setpoint.tolist(),
        "qd": now.motion.qd.tolist(),
        "goal": now.goal.tolist(),
        "gripper": now.gripper,
        "gripper_goal": now.gripper_goal,
        "holding": None if arm.holding is None else arm.holding.tolist(),
        "touching": list(touching(hand, now)),
        "touch": None if hand is None or not hand.can_hold else touch(hand, now),
        "held": None if now.held is None else now.held.name,
        "status": now.status.value,
        "why": sentence(now),
        "findings": [finding(cause) for cause in now.findings],
        "speed": now.speed,
        "silence_profile": arm.profile.value,
        "water": water(arm.session.pouring, now),
        "arm": None if now.report is None else measured_arm(now.report),
        **(NO_TOOL if mounted is None else _of_tool(mounted, arm.margins, now)),
    }


def touch(hand: Hand, now: control.State) -> answers.Touch:
    """Return the forces of the fingers as a part of an answer."""
    return answers.Touch(
        preload=now.squeeze,
        force_limit=FINGER_FORCE if hand.cup is None else hand.cup.force,
        fingers=[
            answers.FingerForce(finger=name, force=force)
            for name, force in finger_forces(hand, now).items()
        ],
    )


def measured_arm(report: ArmReport) -> answers.MeasuredArm:
    """Return the report of a driver as a part of an answer."""
    stop = report.measured_stop
    return answers.MeasuredArm(
        mode=report.mode.value,
        note=report.note,
        acts=[act.value for act in report.mode.acts],
        t=report.t,
        expected=report.expected.tolist(),
        speeds=None if report.speeds is None else report.speeds.tolist(),
        round_trip=report.round_trip,
        stop_time=None if stop is None else stop.time,
        stop_angle=None if stop is None else stop.angle,
        stop_distance=None if stop is None else stop.distance,
        sensors=list(report.sensors),
    )


def margins(distances: Margins) -> answers.Margins:
    """Return the distances to limits, singularity and contact as a part of an answer."""
    nearest = distances.nearest
    return answers.Margins(
        limit=float(distances.limits[distances.axis]),
        axis=distances.axis + 1,
        limits=distances.limits.tolist(),
        smallest_singular_value=float(distances.singular_values[-1]),
        clearance=None if nearest is None else nearest.distance,
        parts=None if nearest is None else nearest.parts,
    )


def _of_tool(arm: MountedArm, distances: Margins, now: control.State) -> dict[str, Any]:
    """Return the fields of a state about the tool of ``arm``; ``distances``: its margins."""
    kinematics = arm.kinematics_to(now.tool)
    target = kinematics.target_at(now.q)
    return {
        "tool": now.tool,
        "T": forward(kinematics.chain, now.q).tolist(),
        "pitch": target.pitch if target.is_pitched else None,
        "roll": target.roll if target.is_pitched else None,
        "tool_speed": kinematics.tool_speed(now.setpoint, now.motion.qd),
        "margins": margins(distances),
        "branch": tuple(str(now.branch).split("-")),
        "priority": now.priority.value,
    }


def water(pouring: Pouring | None, now: control.State) -> answers.Water | None:
    """Return the water as a part of an answer; None without a cup."""
    if pouring is None or now.poured is None:
        return None
    water = now.poured.water
    return answers.Water(
        cup_ml=water.cup.volume / MILLILITRE,
        basin_ml=water.basin / MILLILITRE,
        air_ml=water.air / MILLILITRE,
        spilled_ml=water.spilled / MILLILITRE,
        vessels_ml={vessel.name: vessel.volume / MILLILITRE for vessel in water.others},
        margin_to_rim=pouring.margin_to_rim(now.poured, now.objects),
    )


def arm(handle: ArmHandle) -> answers.Arm:
    """Return the description of the arm of ``handle``."""
    robot, mounted = handle.robot, handle.robot.arm
    model = robot.joint_group if mounted is None else mounted
    names = robot.joint_group.names if mounted is None else mounted.chain.names
    limits, gripper = model.limits, model.gripper
    return answers.Arm(
        name=robot.name,
        joints=list(names),
        lower=limits.lower.tolist(),
        upper=limits.upper.tolist(),
        speed=limits.speed.tolist(),
        acceleration=limits.acceleration.tolist(),
        jerk=limits.jerk.tolist(),
        ready=handle.session.ready.tolist(),
        tools={} if mounted is None else {name: M.tolist() for name, M in mounted.tools.items()},
        default_tool=None if mounted is None else mounted.default_tool,
        gripper=(gripper.closed, gripper.opened, gripper.speed) if gripper.moves else None,
        gripper_slides=gripper.slides,
        suction_cup=gripper.is_cup,
        T_base_shoulder=None if mounted is None else mounted.T_base_shoulder.tolist(),
        slides=list(model.slides),
        links=_joint_links(robot, names),
        joints_only=robot.why,
        freedoms=0 if mounted is None else mounted.kinematics.freedoms,
        turns_elbow=mounted is not None and mounted.kinematics.turns_elbow,
    )


def _joint_links(robot: Robot, names: Sequence[str]) -> list[answers.JointLink]:
    """Return the link that each of the joints ``names`` moves."""
    moved = {link.joint.name: link for link in robot.links if link.joint is not None}
    return [
        answers.JointLink(
            label=label,
            path=[member.name for member in robot.path_to(moved[name])],
            axis=robot.joints[name].axis.tolist(),
        )
        for name, label in zip(names, robot.joint_labels, strict=True)
    ]


def branch_option(choice: BranchOption) -> answers.BranchOption:
    """Return a branch that can be chosen as a part of an answer."""
    branch = choice.branch
    return msgspec.convert(
        {
            **vars(choice),
            "name": str(branch),
            "shoulder": None if isinstance(branch, str) else branch.shoulder,
            "elbow": None if isinstance(branch, str) else branch.elbow,
            "q": choice.q.tolist(),
            "contact": None if choice.contact is None else choice.contact.parts,
        },
        answers.BranchOption,
    )


def objects(arm: ArmHandle) -> answers.Objects:
    """Return all scene objects as an answer."""
    now = arm.state
    return answers.Objects(
        objects=[
            answers.SceneObject(
                name=scene_object.name,
                shape=scene_object.shape.value,
                size=list(scene_object.size),
                T=arm.environment.pose(scene_object, now.x).tolist(),
                can_be_held=scene_object.can_be_held,
                held=scene_object.held,
                mesh=None if scene_object.solid is None else scene_object.solid.key,
                scale=scene_object.scale,
                colour=scene_object.appearance.colour
                and hexadecimal(scene_object.appearance.colour),
                opacity=scene_object.appearance.opacity,
                hidden=scene_object.appearance.hidden,
                fixed=scene_object.fixed,
                zone=scene_object.zone.value,
                overlap=arm.environment.overlap(scene_object, now.x),
            )
            for scene_object in now.objects
        ]
    )


def hexadecimal(colour: Colour) -> str:
    """Return ``colour`` as text such as "#94a3b8"."""
    red, green, blue = colour
    return f"#{red:02x}{green:02x}{blue:02x}"


def loop(loop_timing: LoopTiming) -> answers.Loop:
    """Return the timing of the control loop as an answer."""
    return msgspec.convert(loop_timing, answers.Loop, from_attributes=True)


def once(snapshot: Snapshot, name: str, work: Callable[[], T]) -> T:
    """Return the result of ``work``, computed at the first request of ``name`` for ``snapshot``.

    An error is raised and not kept.
    """
    results = _FOUND.setdefault(snapshot, {})
    if name not in results:
        results[name] = work()
    value: T = results[name]
    return value
