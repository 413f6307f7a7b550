"""The closed form of seven axes: one joint is locked at chosen angles, the other six are solved.

Seven axes take a pose in a curve of postures for each branch. The locked joint is its parameter: it
sets the arm angle, and its angle is called so here. The formulas are those of spherical_wrist.py,
on arrays of arm angles:

    axis 3 locked    axes 1 and 2 meet, and 5, 6 and 7 (iiwa): the lock is part of the link between
                     axes 2 and 4.
    axis 1 locked    axes 2 to 7 have a spherical wrist: the lock moves the base of the others.
    axis 7 or 5      the same seen from the tool (Panda: axes 1, 2 and 3 meet, and 5 and 6).

Of all arm angles, the posture of each branch is taken that keeps farthest from the joint limits, or
nearest to a given posture, inside the limits if there is one. A grid covers the whole range.
Each branch is computed when it is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.extensions.general_arms.branch_words import BranchWords
from katana450.extensions.general_arms.functions import ARRAYS, Operations
from katana450.extensions.general_arms.links import DHLinks, links_of, reversed_chain
from katana450.extensions.general_arms.numerical import search_of
from katana450.extensions.general_arms.refinement import FileRounding
from katana450.extensions.general_arms.spherical_wrist import (
    Solve,
    arm_angle_link,
    crossing_shoulder,
    is_crossing_shoulder,
    is_parallel_shoulder,
    parallel_shoulder,
    wrist_centre,
)
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import errors_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.solution import Angles, Solutions
from katana450.maths.kinematics.turns import in_limits_turns, nearest_turn

_TURNS: Final = 1.0 / math.tau  # [1/rad]

ARM_ANGLES: Final = 128
"""Number of arm angles on the grid."""

REACHED: Final = ARRAYS._replace(
    root=np.sqrt, bounded=lambda x: x, where_free=lambda _condition, _a, b: b
)
"""Operations whose angles are not numbers where no posture takes the pose, nor at a singularity."""

ROUNDED: Final = 1e-14
"""[1], [m^2] Negative number whose root is 0, because it is only rounding."""

BOUNDED: Final = ARRAYS._replace(
    root=lambda x: np.sqrt(np.where((x < 0.0) & (x > -ROUNDED), 0.0, x))
)
"""Operations whose angles are not numbers where no posture takes the pose, beyond rounding."""

NEAR_MISS: Final = 1e-3
"""[m] Distance of axes up to which the postures of an arm whose axes meet lead to those of the arm.
The wrist of a Kinova Gen3 misses by 0.35 mm."""

CONTINUITY: Final = 10.0
"""Weight of the distance to a given posture [1/rad] beside the room to the limits."""


def _six_of(links: DHLinks) -> DHLinks:
    """Return the links of axes 1, 2, 4, 5, 6, 7 as far as `crossing_shoulder` reads them."""
    return DHLinks(
        a=(links.a[0], 0.0, *links.a[3:]),
        d=(links.d[0], 0.0, *links.d[3:]),
        t=(links.t[0], 0.0, *links.t[3:]),
        b=(links.b[0], 0.0, *links.b[3:]),
        shift=(*links.shift[:2], *links.shift[3:]),
        T_S_1=links.T_S_1,
        T_n_tool=links.T_n_tool,
    )


def _locks_third(links: DHLinks) -> bool:
    """Return whether axis 3 can be locked: `crossing_shoulder` then solves the others."""
    if not (links.crosses(1) and links.meet(5)):
        return False
    six = _six_of(links)
    cx, cy, _ = wrist_centre(six)
    between = np.array(arm_angle_link(links, np.linspace(-3.0, 3.0, 13)))
    x = between[0] * between[3] + between[4] * between[7] + between[8] * between[11]
    y = between[1] * between[3] + between[5] * between[7] + between[9] * between[11]
    return bool(math.hypot(cx, cy) * np.hypot(x, y).min() > tolerances.FAMILY_LENGTH**2)


def _locks_first(links: DHLinks) -> bool:
    """Return whether axis 1 can be locked: axes 2 to 7 then have a spherical wrist."""
    six = links.from_axis(1)
    return is_parallel_shoulder(six) or is_crossing_shoulder(six)


@dataclass(frozen=True, eq=False)
class SevenAxes(Kinematics):
    """Inverse kinematics of seven axes with the joint ``locked`` as parameter.

    Attributes:
        chain: the chain.
        links: of the chain, or of the chain seen from the tool.
        locked: index of the parameter in `links`, 0 or 2.
        is_reversed: whether `links` are seen from the tool.
    """

    links: DHLinks
    locked: int
    is_reversed: bool

    @staticmethod
    def of(chain: Chain) -> SevenAxes | str:
        """Return the closed form of `chain`, or the conditions that it misses.

        Axes that pass each other within NEAR_MISS count as meeting if those that meet are too few.
        """
        mirrored = reversed_chain(chain)
        for gap in (tolerances.FAMILY_LENGTH, NEAR_MISS):
            views = ((links_of(chain, gap=gap), False), (links_of(mirrored, gap=gap), True))
            for locked, can_lock in ((2, _locks_third), (0, _locks_first)):
                for view, is_reversed in views:
                    if can_lock(view):
                        return SevenAxes(chain, view, locked, is_reversed)
        return (
            "whichever joint is locked, the other six do not have three axes at one end that meet "
            "in one point, and beside these two that meet or are parallel"
        )

    @cached_property
    def rounding(self) -> FileRounding:
        """The rounding of the file of the chain; `at_arm_angles` does not correct it."""
        return FileRounding(self.chain, self.links)

    @property
    def file_offset(self) -> float:
        """`FileRounding.offset`."""
        return self.rounding.offset

    @property
    def arm_angle_joint(self) -> int:
        """Index, from 0, of the joint of the chain that is the parameter."""
        return 6 - self.locked if self.is_reversed else self.locked

    @property
    def method(self) -> str:
        """The method in words."""
        axis = self.arm_angle_joint + 1
        return f"closed form for seven axes whose arm angle is set by axis {axis}"

    @cached_property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, in the order of the solutions; see branch_words.py."""
        joint = self.arm_angle_joint
        return self._words.in_order(lambda T, q: self.at_arm_angles(T, q[[joint]])[0])

    @cached_property
    def _words(self) -> BranchWords:
        joints = tuple(k for k in range(7) if k != self.arm_angle_joint)
        return BranchWords(self.chain, joints, self.is_reversed)

    def branch_of(self, q: FloatArray) -> str:
        """Return the branch of the joint angles `q` (7,) [rad].

        Beside the edge of a branch, both postures of axes that meet lead to one of an arm whose
        axes miss each other, so its branch is measured at its axes.
        """
        return self._words.of(q) if self.rounding.is_corrected else str(super().branch_of(q))

    def at_arm_angles(self, T: FloatArray, arm_angles: FloatArray) -> FloatArray:
        """Return the joint angles (N, 8, 7) [rad] at `arm_angles` (N,).

        They are for the pose `T` (4, 4), or for one pose at each arm angle (N, 4, 4).
        """
        q = np.empty((len(arm_angles), 8, 7))
        with np.errstate(all="ignore"):
            for k, angles in enumerate(self._at(arm_angles, ARRAYS)(self._rows(T))):
                q[:, k] = angles.T
        return in_limits_turns(self.chain, q)

    def _rows(self, T: FloatArray) -> FloatArray:
        """Return poses (..., 4, 4) as the formulas read them."""
        if self.is_reversed:
            T = se3.inverse(T) if T.ndim == 2 else _inverses(T)
        before, after = self.links.T_1_S, self.links.T_tool_n
        return np.asarray(before.dot(T).dot(after) if T.ndim == 2 else before @ T @ after)

    @cached_property
    def _first_link(self) -> FloatArray:
        """The inverse (4, 4) of the link between axes 1 and 2."""
        return se3.inverse(self.links.link(0))

    def _at(
        self, arm_angles: FloatArray, f: Operations
    ) -> Callable[[FloatArray], Iterator[FloatArray]]:
        """Return a function of `_rows` for the joint angles (7, N) [rad] of each branch in turn.

        The angles may be whole turns beyond the limits.
        """
        links, locked, order = self.links, self.locked, -1 if self.is_reversed else 1
        alpha = arm_angles + links.shift[locked]
        before, columns_before = None, np.empty(0)
        if locked == 2:
            solve = crossing_shoulder(_six_of(links), f, arm_angle_link(links, alpha))
            places = (0, 1, 3, 4, 5, 6)
        else:
            solve, places = _after_first(links, f), (1, 2, 3, 4, 5, 6)
            before = self._first_link @ _turned_back(alpha)
            columns_before = np.moveaxis(before, 0, -1).copy()
        shifts = [links.shift[place] for place in places]

        def branches(rows: FloatArray) -> Iterator[FloatArray]:
            if rows.ndim == 2:
                # The same pose at all arm angles: one product without a copy.
                columns = rows[..., None] if before is None else rows.T @ columns_before
            else:
                columns = np.moveaxis(rows if before is None else before @ rows, 0, -1).copy()
            for angles in solve(columns, shifts):
                q = np.empty((7, len(arm_angles)))
                q[locked] = arm_angles
                for place, angle, shift in zip(places, angles, shifts, strict=True):
                    q[place] = angle - shift
                yield q[::order]

        return branches

    def postures(self, T: FloatArray, near: FloatArray) -> FloatArray:
        """Return `best` of all branches with ``near`` as the hint."""
        return np.array([*self.best(T, near)])

    def at_arm_angle_of(self, T: FloatArray, near: FloatArray) -> FloatArray:
        """Return `at_arm_angles` with the arm angle of ``near`` for each of the poses, refined."""
        q = self.at_arm_angles(T, np.full(len(T), near[self.arm_angle_joint]))
        return self._refined(q.reshape(-1, 7), np.repeat(T, 8, axis=0)).reshape(q.shape)

    def _refined(self, q: FloatArray, T: FloatArray) -> FloatArray:
        """Return postures `q` (N, 7) [rad] as those of the arm in the file, at their arm angles."""
        return self.rounding.corrected(q, T, locked=(self.arm_angle_joint,))

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return a posture for each of `branches`; see `Kinematics.inverse`.

        With `q_hint` (7,) [rad] it is the one nearest to the hint, weighed against the room to the
        limits; else the one with the most room.
        """
        pose = se3.validated(T)
        hint = None if q_hint is None else self.chain.check_q(q_hint)
        return Solutions(self.chain, pose, self.best(pose, hint), self.branches)

    def best(self, T: FloatArray, hint: FloatArray | None = None) -> Iterator[Angles]:
        """Yield the joint angles (7,) [rad] of the best arm angle of each branch."""
        postures = self._best(T, hint)
        if self.rounding.is_corrected:
            poses = np.broadcast_to(T, (8, 4, 4))
            # With the elbow almost straight, another arm angle may take the pose.
            q = self.rounding.corrected(self._refined(np.array([*postures]), poses), poses)
            postures = map(tuple, self._turned(q.T, hint).T.tolist())
        yield from postures

    def _best(self, T: FloatArray, hint: FloatArray | None) -> Iterator[Angles]:
        """Yield `best` of the exact arm."""
        rows, solved = self._rows(T), self._on_grid
        if hint is not None:
            # The posture next to the hint may lie where the arm angle hardly changes on the curve.
            neighbour = search_of(self.chain).solve(T, hint, seeds=0)
            joint = self.arm_angle_joint
            ends = self._bounded(np.array([hint[joint], neighbour[joint]]))
            solved = self._at(np.append(self._grid, ends), BOUNDED)
        postures = solved(rows)
        for branch in range(8):
            with np.errstate(all="ignore"):
                q = self._turned(next(postures), hint)
                cost = self._cost(q, hint)
            best = int(cost.argmin())
            q = q[:, best]
            if cost[best] == math.inf:
                # No arm angle takes the pose: the one that comes nearest.
                with np.errstate(all="ignore"):
                    q = next(islice(self._near_grid(rows), branch, None))
                targets = np.broadcast_to(T, (ARM_ANGLES, 4, 4))
                position, rotation = errors_of(self.chain, q.T[:, None], targets)
                q = self._turned(q, hint)[:, int((position + rotation).argmin())]
            yield tuple(q.tolist())

    @cached_property
    def _grid(self) -> FloatArray:
        low, high = self._range
        return np.linspace(low, high, ARM_ANGLES, endpoint=False) + 0.5 * (high - low) / ARM_ANGLES

    @cached_property
    def _on_grid(self) -> Callable[[FloatArray], Iterator[FloatArray]]:
        return self._at(self._grid, REACHED)

    @cached_property
    def _near_grid(self) -> Callable[[FloatArray], Iterator[FloatArray]]:
        return self._at(self._grid, ARRAYS)

    @cached_property
    def _range(self) -> tuple[float, float]:
        joint = self.arm_angle_joint
        low, high = float(self.chain.lower[joint]), float(self.chain.upper[joint])
        return (low, high) if high - low < math.tau else (-math.pi, math.pi)

    def _bounded(self, arm_angles: FloatArray) -> FloatArray:
        """Return `arm_angles` [rad] inside the range of the grid."""
        low, high = self._range
        turns = np.round((arm_angles - 0.5 * (low + high)) / math.tau)
        return np.clip(arm_angles - math.tau * turns, low, high)

    @cached_property
    def _limits(self) -> tuple[FloatArray, FloatArray]:
        """The middle (7, 1) and the width (7, 1) of the joints' ranges [rad]."""
        lower, upper = self.chain.lower[:, None], self.chain.upper[:, None]
        return 0.5 * (lower + upper), upper - lower

    def _turned(self, q: FloatArray, hint: FloatArray | None) -> FloatArray:
        """Return `q` (7, N) [rad] in the turns amid the limits, or nearest to a hint."""
        middle, _ = self._limits
        q = q - math.tau * np.rint((q - middle) * _TURNS)
        return q if hint is None else nearest_turn(self.chain, q.T, hint).T

    def _cost(self, q: FloatArray, hint: FloatArray | None) -> FloatArray:
        """Return a number (N,) for each of `q` (7, N) [rad], least for the best.

        It is infinite for a posture that misses the pose. Else it is the excess over the limits or
        the room to them, as a fraction, and with a hint the distance to it. Then the limits weigh
        100.
        """
        middle, width = self._limits
        cost: FloatArray = (np.abs(q - middle) / width).max(axis=0) - 0.5
        if hint is not None:
            cost += np.where(cost > 0.0, 100.0, 0.0)
            cost += CONTINUITY * np.abs(q.T - hint).max(axis=-1)
        cost[np.isnan(cost)] = math.inf
        return cost


@lru_cache(maxsize=64)
def _after_first(links: DHLinks, f: Operations) -> Solve:
    """Return the solver of the axes after the first."""
    six = links.from_axis(1)
    form = parallel_shoulder if is_parallel_shoulder(six) else crossing_shoulder
    return form(six, f)


def _turned_back(alpha: FloatArray) -> FloatArray:
    """Return the poses (N, 4, 4) of turns about z by the negative angles `alpha` (N,) [rad]."""
    turns = np.zeros((len(alpha), 4, 4))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(alpha)
    turns[:, 0, 1] = sine = np.sin(alpha)
    turns[:, 1, 0] = -sine
    turns[:, 2, 2] = turns[:, 3, 3] = 1.0
    return turns


def _inverses(T: FloatArray) -> FloatArray:
    """Return the inverse poses of `T` (N, 4, 4)."""
    result = np.zeros_like(T)
    result[:, :3, :3] = T[:, :3, :3].swapaxes(1, 2)
    result[:, :3, 3] = -(result[:, :3, :3] @ T[:, :3, 3:])[:, :, 0]
    result[:, 3, 3] = 1.0
    return result
