"""Following a dragged pose: the goal moves on from its present posture along the path of the drag.

Six axes with a closed form take the posture of their branch at each place of the path, if it is a
hop away. At limits, out of reach, and for all other arms, `Descent` leads the goal on. Its steps
can turn the arm angle of seven axes to the edge of the branch; a way that leads on with the arm
angle as it was is then taken.
The goal stays on its branch and never leaps; a pose that only a leap would reach is reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Final

import numpy as np

from katana450 import tolerances
from katana450.extensions.general_arms.descent import NEAR, WALL, Angles, Descent
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import HOP, MIN_LEAP_GAIN, Tracked, stops_between

MAX_EFFORT: Final = 20
"""Maximum effort of one call, in looks at a posture. The next call continues."""

MIN_EFFORT: Final = 8
"""Minimum effort of the descent on a stride, so that it makes some steps."""

EFFORT_OF_FORM: Final = 2
"""Effort of a posture in closed form, in looks."""

LEAST_PART: Final = 1.0 / 32.0
"""[1] Smallest part of a stride that the closed form is asked for."""

ARM_ANGLE_SAMPLES: Final = 24
"""Number of places of a stride to which a branch of seven axes is followed with its arm angle."""

EXACT: Final = 1e-8
"""[rad], [arm lengths] Error of the pose up to which a closed form's posture takes it."""


@dataclass(frozen=True, eq=False)
class PoseTracker:
    """The tracker of one arm. Its methods are pure."""

    descent: Descent
    branches: Kinematics

    @property
    def chain(self) -> Chain:
        """The chain."""
        return self.descent.search.chain

    def track(
        self,
        q: FloatArray,
        target: ToolTarget,
        since: ToolTarget,
        branch: str,
        priority: Priority,
        projected: Callable[[FloatArray], Projection],
    ) -> Tracked:
        """Return the goal moved on from `q` (n,) [rad] on ``branch`` towards ``target``.

        ``projected`` returns the projection of ``target`` that joint angles give.
        """
        angles, effort, place = tuple(self.chain.clamp(q).tolist()), MAX_EFFORT, since
        for stop in chain(stops_between(since, target), (target,)):
            before = angles
            angles, effort, ended = self._advanced(angles, place, stop, branch, priority, effort)
            if place is since and not ended and self._is_led_along_edge(angles, stop, priority):
                at_arm_angle = self._at_its_arm_angle(before, stop, branch)
                angles, ended = (angles, False) if at_arm_angle is None else (at_arm_angle, True)
            if not ended or (effort <= 0 and stop is not target):
                return Tracked(projected(np.array(angles)), since=stop if ended else place)
            place = stop
        goal = np.array(angles)
        beyond = self._beyond(goal, target, branch, priority)
        return Tracked(projected(goal), None if beyond is None else projected(beyond))

    def _advanced(
        self,
        q: Angles,
        start: ToolTarget,
        stop: ToolTarget,
        branch: str,
        priority: Priority,
        effort: int,
    ) -> tuple[Angles, int, bool]:
        """Return `q` moved from ``start`` to ``stop``, the effort left, and whether it is done."""
        done, part = 0.0, 1.0
        while self.branches.is_exact and priority is Priority.POSE and done < 1.0 and effort > 0:
            place = stop if done + part >= 1.0 else start.towards(stop, done + part)
            angles = self._exact(place, branch, q)
            effort -= EFFORT_OF_FORM
            if angles is None or part < LEAST_PART:
                break
            if max(abs(a - b) for a, b in zip(angles, q, strict=True)) > HOP:
                part *= 0.5
                continue
            q, done = angles, min(done + part, 1.0)
            part = min(2.0 * part, 1.0 - done)
        if done >= 1.0:
            return q, effort, True
        goal = self.descent.goal(stop)
        end = self.descent.run(goal, q, priority, max(effort, MIN_EFFORT))
        effort -= end.effort
        if self.descent.look(goal, q).least < WALL and self._leaves(end.q, branch):
            return q, effort, True
        return end.q, effort, end.ended

    def _is_led_along_edge(self, q: Angles, stop: ToolTarget, priority: Priority) -> bool:
        """Return whether steps of seven axes towards ``stop`` ended at the edge of the branch."""
        if self.branches.arm_angle_joint is None or priority is not Priority.POSE:
            return False
        now = self.descent.look(self.descent.goal(stop), q)
        return now.least < NEAR and float(np.abs(now.error).max()) > EXACT

    def _at_its_arm_angle(self, q: Angles, stop: ToolTarget, branch: str) -> Angles | None:
        """Return the posture of ``branch`` at ``stop`` with the arm angle of `q`.

        None without a way there. On it every posture is inside the limits, clear of the edge, and a
        hop from the last.
        """
        near = np.array(q)
        number = self.branches.branches.index(branch)

        def on_branch(places: Sequence[ToolTarget]) -> FloatArray:
            T = np.array([place.T for place in places])
            postures = self.branches.at_arm_angle_of(T, near)
            assert postures is not None
            return postures[:, number]

        if not self._takes(stop, on_branch([stop])[0]):
            return None
        start = ToolTarget.of(forward(self.chain, near))
        places = [
            *(start.towards(stop, k / ARM_ANGLE_SAMPLES) for k in range(1, ARM_ANGLE_SAMPLES)),
            stop,
        ]
        steps = np.diff(on_branch(places), axis=0, prepend=near[None])
        steps -= math.tau * np.round(steps / math.tau)
        postures = near + np.cumsum(steps, axis=0)
        leads = np.abs(steps).max() <= HOP and all(map(self._takes, places, postures))
        return tuple(self.chain.clamp(postures[-1]).tolist()) if leads else None

    def _takes(self, place: ToolTarget, q: FloatArray) -> bool:
        """Return whether `q` (n,) takes the pose inside the limits, clear of the edge."""
        if not (np.isfinite(q).all() and self.chain.within_limits(q)):
            return False
        now = self.descent.look(self.descent.goal(place), tuple(q.tolist()))
        return now.least >= WALL and float(np.abs(now.error).max()) <= EXACT

    def _leaves(self, q: Angles, branch: str) -> bool:
        return self.branches.are_separate and self.branches.branch_of(np.array(q)) != branch

    def _exact(self, place: ToolTarget, branch: str, q: Angles) -> Angles | None:
        """Return the posture of ``branch`` at ``place`` inside the limits; None without one."""
        near = np.array(q)
        posture = self.branches.on_branch(place.T, branch, near)
        if posture is None or not self.chain.within_limits(posture):
            return None
        angles = tuple(self.chain.clamp(posture).tolist())
        now = self.descent.search.step(self.descent.goal(place), angles)
        return angles if now.square <= EXACT * EXACT else None

    def _beyond(
        self, q: FloatArray, target: ToolTarget, branch: str, priority: Priority
    ) -> FloatArray | None:
        """Return the exact posture of the branch for ``target``, if `q` (n,) misses it."""
        goal = self.descent.goal(target)
        misses = self.descent.misses(self.descent.look(goal, tuple(q.tolist())), priority)
        if max(misses) <= MIN_LEAP_GAIN or self.chain.n < 6:
            return None
        posture = self.branches.on_branch(target.T, branch, q)
        if posture is None or not self.chain.within_limits(posture):
            return None
        posture = self.chain.clamp(posture)
        after = self.descent.look(goal, tuple(posture.tolist()))
        exact = max(map(abs, after.error.tolist())) <= math.sqrt(tolerances.SAME_POSITION)
        return posture if exact else None
