"""One tick of motion for joints that are driven one by one, without a tool or a collision world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from katana450.arm.control.joints import JointSet
from katana450.arm.control.state import State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.motion.limiter import JointMotion, Limiter
from katana450.maths.motion.pursuit import stream_step

Travel = Callable[[FloatArray, FloatArray], float]
"""The distance [m] that the links travel between two joint vectors (n,)."""


def no_travel(_q: FloatArray, _to: FloatArray) -> float:
    """Return 0 m, the travel of links whose lengths are unknown."""
    return 0.0


class JointStepper:
    """Moves the setpoints of joints, tick by tick. Its methods are pure."""

    def __init__(self, joints: JointSet, travel: Travel) -> None:
        self._joints = joints
        self._travel = travel
        self._limiter = Limiter(joints.limits)

    def step(self, state: State, dt: float) -> State:
        """Return ``state`` with its setpoints advanced by ``dt`` [s]."""
        if dt <= 0.0 or not state.under_way:
            return state
        return replace(state, motion=self._ahead(state, dt))

    def stopping_point(self, state: State) -> tuple[FloatArray, float, float]:
        """Return the end of a brake begun now, (n,) [rad or m], the travel [m] and the time [s]."""
        motion = state.motion
        end = self._joints.clamp(self._limiter.stopping_point(motion))
        return end, self._travel(motion.q, end), self._limiter.stopping_time(motion)

    def may_leave(self, state: State) -> bool:  # noqa: ARG002
        """Return True: the joints follow no plan, so they may always brake."""
        return True

    def _ahead(self, state: State, dt: float) -> JointMotion:
        limiter, motion, servo = self._limiter, state.motion, state.servo
        if state.stopped is not None:
            return limiter.stop(motion, dt)
        if state.paused:
            return limiter.pause(motion, state.goal, dt)
        if servo is None:
            return limiter.towards(motion, state.goal, dt, state.speed)
        return stream_step(limiter, motion, servo, state.t, dt, state.speed)
