"""The first state of an arm whose process was started again."""

from __future__ import annotations

from dataclasses import replace

from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.state import ActiveStop, Finding, Reason, State
from katana450.arm.control.state.stop_cause import StopCause
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


def restarted(first_state: State, last_state: State | None) -> State:
    """Return the first state of a new process, stopped and with the scene of the last state.

    last_state: the last known one of the process before; None if none is known. The place of the
    arm is that of ``first_state``, which its driver reports.
    """
    stopped = at_rest(first_state)
    if last_state is None:
        return stopped
    return replace(
        stopped,
        tool=last_state.tool,
        priority=last_state.priority,
        speed=last_state.speed,
        objects=last_state.objects,
        grip=last_state.grip,
        squeeze=last_state.squeeze,
        poured=last_state.poured,
        appearance=last_state.appearance,
    )
