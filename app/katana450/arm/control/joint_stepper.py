"""One tick of motion for joints that are driven one by one, without a tool."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from katana450.arm.control.contact_rule import (
    may_go_on,
    met_before_rest,
    with_contact,
    with_distance,
)
from katana450.arm.control.joints import JointSet
from katana450.arm.control.state import State
from katana450.maths.collision.world import CollisionWorld
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

    def __init__(
        self, joints: JointSet, travel: Travel, world: CollisionWorld | None = None
    ) -> None:
        """Create the stepper. ``world`` is the collision world; None to check no contacts."""
        self._joints = joints
        self._travel = travel
        self._world = world
        self._limiter = Limiter(joints.limits)

    def step(self, state: State, dt: float) -> State:
        """Return ``state`` with its setpoints advanced by ``dt`` [s].

        A step is taken only if the path of the brake behind it is clear; see ``contact_rule``.
        """
        if dt <= 0.0:
            return state
        if not state.under_way:
            return replace(state, blocked=False) if state.blocked else state
        if self._world is None:
            return replace(state, motion=self._ahead(state, dt))
        if state.blocked and state.motion.at_rest and may_go_on(self._world, state):
            state = replace(state, blocked=False)
        # A brake continues to rest: at the edge of the clear path the joints would only quiver.
        if state.blocked:
            braked = replace(state, motion=self._limiter.stop(state.motion, dt))
            return with_distance(self._world, braked)
        ahead = self._ahead(state, dt)
        met = met_before_rest(self._world, self._limiter, state.x_setpoint, ahead)
        if met is not None:
            ahead = self._limiter.stop(state.motion, dt)
        return with_contact(replace(state, motion=ahead, blocked=met is not None), met)

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
