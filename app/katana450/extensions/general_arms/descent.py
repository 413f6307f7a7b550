"""Steps of a posture towards a target that never leave its branch, its limits, or leap.

A step minimises the weighted error of the pose, with the joints at a limit and the edge of the
branch as constraints: the arm slides along what it meets. The priority sets the weights.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.general_arms.numerical import Numerical, search_of
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import HOP

WALL: Final = 0.02
"""[1] Smallest singular value below which a motion without a closed form leads no farther."""

SINGULAR: Final = 1e-9
"""[1] Smallest singular value that is only rounding."""

NEAR: Final = 0.1
"""[1] Smallest singular value from which on a step need not regard the edge."""


@dataclass(frozen=True)
class Regularity:
    """The distance of a posture from the edge of its branch, for arms of any number of axes.

    The matrix that decides has as many rows as the tool has freedoms that the arm can choose: all
    six from six axes on, and with n < 6 axes the tool point and the turns about the last n - 3
    axes. A branch ends where it loses rank. With the joint locked that sets the arm angle of
    seven axes, the other six decide, because they define the branches.

    Weyl's inequality keeps a step on its branch: the smallest singular value changes by at most the
    norm of the change of the matrix. A step that changes it by less never passes a singular
    posture.

    Attributes:
        n: number of axes of the chain.
        arm_angle_joint: index of a locked joint, or None.
    """

    n: int
    arm_angle_joint: int | None = None

    @cached_property
    def _others(self) -> list[int]:
        return [k for k in range(self.n) if k != self.arm_angle_joint]

    def matrix(self, J: FloatArray) -> FloatArray:
        """Return the matrix for the Jacobian `J` (6, n), whose translations are over a length."""
        if self.arm_angle_joint is not None:
            return J.take(self._others, axis=-1)
        if self.n >= 6:
            return J
        turns = J[:3, min(3, self.n) :]
        return np.concatenate((turns.T @ J[:3], J[3:]))

    @staticmethod
    def least(matrix: FloatArray) -> float:
        """Return the smallest singular value of a matrix."""
        return float(np.linalg.svd(matrix, compute_uv=False)[-1])

    @staticmethod
    def allows(least: float, before: FloatArray, least_after: float, after: FloatArray) -> bool:
        """Return whether a step between two matrices stays on the branch, clear of its edge.

        Beyond WALL, where an arm may stand, steps lead only back, on the same side of the edge.
        """
        if least >= WALL:
            return least_after >= WALL and float(np.linalg.norm(after - before)) < least
        if least_after < least:
            return False
        rows, columns = before.shape
        if rows != columns or least < SINGULAR:
            return True
        return float(np.linalg.det(before) * np.linalg.det(after)) > 0.0


Angles = tuple[float, ...]

FIRST: Final = 1e4
"""[1] Weight of the square of what comes first, relative to what comes second."""

WEIGHTS: Final[Mapping[Priority, tuple[float, float]]] = {
    Priority.POSE: (1.0, FIRST),
    Priority.POSITION: (0.0, 1.0),
    Priority.ORIENTATION: (FIRST, 1.0),
}
"""Weights of the squared errors of rotation and position."""

REACHED: Final = 1e-10
"""[rad], [arm lengths] Error at which a target counts as reached."""

DAMPING: Final = 1e-6
"""[1] Damping of a step; it chooses among the motions that an arm with free joints has."""

CENTRING: Final = 0.02
"""[1] Part of the way to the middle of their limits that free joints take in a step."""

CENTRED: Final = 0.02
"""[rad], [arm lengths] Error below which they take less of it, in proportion. The bend of their
path would else keep the tool beside its target, and the arm would creep for seconds."""

HALVINGS: Final = 5
"""Maximum number of halvings of a step that brings the tool no nearer."""

EFFORT_OF_SLOPE: Final = 3
"""Effort of a slope, in looks."""

LEAST_GAIN: Final = 1e-3
"""[1] Relative gain of a step below which it counts as slow."""

MAX_SLOW: Final = 3
"""Number of slow steps in a row after which the search ends."""

PROBE: Final = 1e-6
"""[rad] Turn of a joint by which a slope is measured."""


class Look(NamedTuple):
    """A posture [rad] as the search sees it.

    Attributes:
        q: joint angles.
        error: rotation vector [rad] and translation [arm lengths] from the tool to the target.
        J: (n, 6) how the joints lessen it.
        matrix: of `Regularity`.
        least: its smallest singular value.
    """

    q: Angles
    error: FloatArray
    J: FloatArray
    matrix: FloatArray
    least: float


class Descended(NamedTuple):
    """The end of a search: joint angles [rad], its effort in looks, and whether it is complete."""

    q: Angles
    effort: int
    ended: bool


@dataclass(frozen=True, eq=False)
class Descent:
    """The search of one arm. Its methods are pure."""

    search: Numerical
    regularity: Regularity

    @cached_property
    def _ends(self) -> tuple[list[float], list[float]]:
        chain = self.search.chain
        return chain.lower.tolist(), chain.upper.tolist()

    @cached_property
    def _middle(self) -> FloatArray:
        chain = self.search.chain
        return 0.5 * (chain.lower + chain.upper)

    def goal(self, target: ToolTarget) -> tuple[float, ...]:
        """Return ``target`` as `Numerical` reads it."""
        return self.search.goal(target.T)

    def look(self, goal: tuple[float, ...], q: Angles) -> Look:
        """Return the posture `q` as seen from ``goal``."""
        chain = self.search.chain
        follows = chain.n < 6 and not chain.slides[0]
        now = self.search.step(_turned_with_axis_1(goal, q[0]) if follows else goal, q)
        J = np.array(now.J)
        matrix = self.regularity.matrix(J.T)
        if follows:
            # The target turns with axis 1, which therefore does not change its orientation.
            J[0, :3] = 0.0
        return Look(q, np.array(now.error), J, matrix, self.regularity.least(matrix))

    def misses(self, look: Look, priority: Priority) -> tuple[float, ...]:
        """Return the errors [m], [rad] that count, in the order of the priority."""
        place = float(np.linalg.norm(look.error[3:])) * self.search.length
        turn = float(np.linalg.norm(look.error[:3]))
        if priority is Priority.POSITION:
            return (place,)
        return (turn, place) if priority is Priority.ORIENTATION else (place, turn)

    def run(
        self, goal: tuple[float, ...], q: Angles, priority: Priority, maximum: int
    ) -> Descended:
        """Return where steps from `q` towards ``goal`` lead; ``maximum`` bounds the effort."""
        weights = np.repeat(WEIGHTS[priority], 3)
        now, slow, effort = self.look(goal, q), 0, 1
        while effort < maximum:
            cost = float(weights @ now.error**2)
            if cost <= REACHED**2 * float(weights.max()):
                return Descended(now.q, effort, ended=True)
            then, spent = self._step(goal, now, weights, cost)
            effort += spent
            if then is None:
                return Descended(now.q, effort, ended=True)
            gained = float(weights @ then.error**2) < (1.0 - LEAST_GAIN) * cost
            slow = 0 if gained else slow + 1
            now = then
            if slow == MAX_SLOW:
                return Descended(now.q, effort, ended=True)
        return Descended(now.q, effort, ended=False)

    def _step(
        self, goal: tuple[float, ...], now: Look, weights: FloatArray, cost: float
    ) -> tuple[Look | None, int]:
        """Return the posture after one step that brings the tool nearer, and the effort.

        The posture is None if no step does.
        """
        slope, effort = None, 0
        if now.least < NEAR:
            slope, effort = self._slope(now), EFFORT_OF_SLOPE
        held: list[int] = []
        while True:
            dq = self._direction(now, weights, slope, held)
            largest = float(np.abs(dq).max())
            if largest <= REACHED:
                return None, effort
            fraction = min(1.0, HOP / largest)
            for tries in range(1, HALVINGS + 1):
                then = self.look(goal, self._moved(now.q, fraction * dq))
                if float(weights @ then.error**2) < cost and self.regularity.allows(
                    now.least, now.matrix, then.least, then.matrix
                ):
                    return then, effort + tries
                fraction *= 0.5
            effort += HALVINGS
            # A joint that its limit cut short spoils the step of the others.
            cut = [k for k in self._beyond(now.q, 2.0 * fraction * dq) if k not in held]
            if not cut:
                return None, effort
            held += cut

    def _beyond(self, q: Angles, dq: FloatArray) -> list[int]:
        lower, upper = self._ends
        moves = enumerate(zip(q, dq.tolist(), lower, upper, strict=True))
        return [k for k, (x, d, a, b) in moves if not a <= x + d <= b]

    def _moved(self, q: Angles, dq: FloatArray) -> Angles:
        lower, upper = self._ends
        moves = zip(q, dq.tolist(), lower, upper, strict=True)
        return tuple(min(max(x + d, a), b) for x, d, a, b in moves)

    def _direction(
        self,
        now: Look,
        weights: FloatArray,
        slope: FloatArray | None,
        held: Sequence[int] = (),
    ) -> FloatArray:
        """Return the step (n,) [rad] of least weighted error.

        ``slope`` (n,): how the smallest singular value rises, which must not fall below WALL.
        ``held``: joints that do not move.
        """
        n = len(now.q)
        lower, upper = self._ends
        weighted = now.J * weights
        A = weighted @ now.J.T + DAMPING * np.eye(n)
        b = weighted @ now.error
        if n > 6 or not weights[0]:
            left = math.sqrt(float(weights @ now.error**2) / float(weights.max()))
            part_of_way = CENTRING * min(1.0, left / CENTRED)
            b = b + DAMPING * part_of_way * (self._middle - np.array(now.q))
        free = [k for k in range(n) if k not in held]
        dq = np.zeros(n)
        while free:
            dq = np.zeros(n)
            part = A[np.ix_(free, free)]
            if slope is None:
                dq[free] = np.linalg.solve(part, b[free])
            else:
                g = slope[free]
                both = np.linalg.solve(part, np.column_stack((b[free], g)))
                along = float(g @ both[:, 1])
                back = float(g @ both[:, 0])
                dq[free] = both[:, 0]
                lowest = min(0.0, 0.5 * (WALL - now.least))
                if back < lowest and along > 0.0:
                    dq[free] += both[:, 1] * ((lowest - back) / along)
            pushed = [
                k
                for k in free
                if (now.q[k] <= lower[k] and dq[k] < 0.0) or (now.q[k] >= upper[k] and dq[k] > 0.0)
            ]
            if not pushed:
                break
            free = [k for k in free if k not in pushed]
            dq = np.zeros(n)
        return dq

    def _slope(self, now: Look) -> FloatArray:
        """Return how the smallest singular value rises with each joint (n,) [1/rad]."""
        matrices = []
        for k in range(len(now.q)):
            q = list(now.q)
            q[k] += PROBE
            _, moved = self.search.motion(q)
            J = np.array(moved).T
            J[3:] /= self.search.length
            matrices.append(self.regularity.matrix(J))
        least = np.linalg.svd(np.array(matrices), compute_uv=False)[:, -1]
        return np.asarray((least - now.least) / PROBE)


@lru_cache(maxsize=64)
def descent_of(solver: Kinematics) -> Descent:
    """Return the search of the arm of ``solver`` on its branches; the result is cached."""
    chain = solver.chain
    return Descent(search_of(chain), Regularity(chain.n, solver.arm_angle_joint))


def _turned_with_axis_1(goal: tuple[float, ...], angle: float) -> tuple[float, ...]:
    """Return ``goal``, in the frame of axis 1, with its rotation turned about that axis [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    turned = []
    for column in range(3):
        x, y, z = goal[3 * column : 3 * column + 3]
        turned += [c * x - s * y, s * x + c * y, z]
    return (*turned, *goal[9:])
