"""The first state of an arm whose process was started again."""

from __future__ import annotations

from dataclasses import replace

from katana450.arm.control.messages import finding_text
from katana450.arm.control.modes import IDLE
from katana450.arm.control.state import ActiveStop, Finding, Reason, State
from katana450.arm.control.stop_cause import StopCause
from katana450.maths.motion.limiter import JointMotion

RESTARTED = (Finding(Reason.STOPPED), Finding(Reason.RESTARTED))
"""Findings of an arm that waits for Clear stop after its process was started again."""

RESTART_CAUSE = StopCause(f"{finding_text(RESTARTED[1])}.")
"""Cause of that stop."""


def at_rest(state: State) -> State:
    """Return the part of ``state`` that outlasts the process of the arm, at rest and stopped.

    The joints and the gripper keep their place, and all targets are dropped.
    """
    return replace(
        state,
        motion=JointMotion.rest(state.q),
        gripper_setpoint=state.gripper,
        goal=state.q,
        gripper_goal=state.gripper,
        findings=RESTARTED,
        blocked=False,
        stopped=ActiveStop(0.0, 0.0, RESTART_CAUSE),
        paused=False,
        mode=IDLE,
        outcomes=(),
    )


def restarted(begun: State, kept: State | None) -> State:
    """Return ``begun``, the first state of a new process, stopped and with the scene of ``kept``.

    kept: the last known state of the process before; None if none is known. The place of the arm
    is that of ``begun``, which its driver reports.
    """
    stopped = at_rest(begun)
    if kept is None:
        return stopped
    return replace(
        stopped,
        tool=kept.tool,
        priority=kept.priority,
        speed=kept.speed,
        objects=kept.objects,
        grip=kept.grip,
        squeeze=kept.squeeze,
        poured=kept.poured,
        appearance=kept.appearance,
    )
