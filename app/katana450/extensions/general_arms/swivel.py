"""The closed form of seven axes: one joint is locked at chosen angles, the other six are solved.

Seven axes take a pose in a curve of postures for each branch. The locked joint is its parameter,
the swivel. The formulas are those of spherical_wrist.py, on arrays of swivels:

    axis 3 locked    axes 1 and 2 meet, and 5, 6 and 7 (iiwa): the lock is part of the link between
                     axes 2 and 4.
    axis 1 locked    axes 2 to 7 have a spherical wrist: the lock moves the base of the others.
    axis 7 or 5      the same seen from the tool (Panda: axes 1, 2 and 3 meet, and 5 and 6).

Of all swivels, the posture of each branch is taken that keeps farthest from the joint limits, or
nearest to a given posture, inside the limits if there is one. A first round tries swivels over the
whole range, a second one between the neighbours of the best.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.extensions.general_arms.branch_words import BranchWords
from katana450.extensions.general_arms.closed_form import inverses
from katana450.extensions.general_arms.file_rounding import FileRounding
from katana450.extensions.general_arms.functions import ARRAYS
from katana450.extensions.general_arms.general_kinematics import GeneralKinematics
from katana450.extensions.general_arms.links import DHLinks, links_of, reversed_chain
from katana450.extensions.general_arms.numerical import search_of
from katana450.extensions.general_arms.spherical_wrist import (
    crossing_shoulder,
    is_crossing_shoulder,
    is_parallel_shoulder,
    parallel_shoulder,
    swivel_link,
    wrist_centre,
)
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import errors_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.solution import Solutions
from katana450.maths.kinematics.turns import in_limits_turns, nearest_turn

SWIVELS: Final = 64
"""Number of swivels of the first round."""

FINER: Final = 9
"""Number of swivels of the second round for each branch."""

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
    between = np.array(swivel_link(links, np.linspace(-3.0, 3.0, 13)))
    x = between[0] * between[3] + between[4] * between[7] + between[8] * between[11]
    y = between[1] * between[3] + between[5] * between[7] + between[9] * between[11]
    return bool(math.hypot(cx, cy) * np.hypot(x, y).min() > tolerances.FAMILY_LENGTH**2)


def _locks_first(links: DHLinks) -> bool:
    """Return whether axis 1 can be locked: axes 2 to 7 then have a spherical wrist."""
    six = links.from_axis(1)
    return is_parallel_shoulder(six) or is_crossing_shoulder(six)


@dataclass(frozen=True, eq=False)
class SevenAxes(GeneralKinematics):
    """Inverse kinematics of seven axes with the joint ``locked`` as parameter.

    Attributes:
        chain: the chain.
        links: of the chain, or of the chain seen from the tool.
        locked: index of the swivel in `links`, 0 or 2.
        is_reversed: whether `links` are seen from the tool.
    """

    links: DHLinks
    locked: int
    is_reversed: bool

    @staticmethod
    def of(chain: Chain, links: DHLinks) -> SevenAxes | str:
        """Return the closed form of `chain`, or the conditions that it misses."""
        views = ((links, False), (links_of(reversed_chain(chain)), True))
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
        """The rounding of the file that describes the chain; `at_swivels` does not correct it."""
        return FileRounding(self.chain, self.links)

    @property
    def swivel(self) -> int:
        """Index, from 0, of the joint of the chain that is the parameter."""
        return 6 - self.locked if self.is_reversed else self.locked

    @property
    def method(self) -> str:
        """The method in words."""
        return f"closed form for seven axes with axis {self.swivel + 1} as the swivel"

    @cached_property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, in the order of the solutions; see branch_words.py."""
        joints = tuple(k for k in range(7) if k != self.swivel)
        words = BranchWords(self.chain, joints, self.is_reversed)
        return words.in_order(lambda T, q: self.at_swivels(T, q[[self.swivel]])[0])

    def at_swivels(self, T: FloatArray, swivels: FloatArray) -> FloatArray:
        """Return the joint angles (N, 8, 7) [rad] at `swivels` (N,).

        They are for the pose `T` (4, 4), or for one pose at each swivel (N, 4, 4).
        """
        links = self.links
        alpha = swivels + links.shift[self.locked]
        if self.is_reversed:
            T = se3.inverse(T) if T.ndim == 2 else inverses(T)
        rows = links.T_1_S @ T @ links.T_tool_n
        zeros = np.zeros_like(swivels)
        with np.errstate(all="ignore"):
            if self.locked == 2:
                six = _six_of(links)
                solve = crossing_shoulder(six, ARRAYS, swivel_link(links, alpha))
                places = (0, 1, 3, 4, 5, 6)
                columns = [[rows[..., i, j] + zeros for j in range(4)] for i in range(4)]
            else:
                six = links.from_axis(1)
                form = parallel_shoulder if is_parallel_shoulder(six) else crossing_shoulder
                solve, places = form(six, ARRAYS), (1, 2, 3, 4, 5, 6)
                columns = _after_first(links, rows, alpha)
            solutions = solve(columns, six.shift)
        q = np.empty((len(swivels), 8, 7))
        q[:, :, self.locked] = swivels[:, None]
        for k, angles in enumerate(solutions):
            for place, angle in zip(places, angles, strict=True):
                q[:, k, place] = angle - links.shift[place]
        return in_limits_turns(self.chain, q[:, :, ::-1] if self.is_reversed else q)

    def postures(self, T: FloatArray, near: FloatArray) -> FloatArray:
        """Return `best` with ``near`` as the hint."""
        return self.best(T, near)

    def at_its_swivel(self, T: FloatArray, near: FloatArray) -> FloatArray:
        """Return `at_swivels` with the swivel of ``near`` for each of the poses."""
        return self.at_swivels(T, np.full(len(T), near[self.swivel]))

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return a posture for each of `branches`; see `Kinematics.inverse`.

        With `q_hint` (7,) [rad] it is the one nearest to the hint, weighed against the room to the
        limits; else the one with the most room.
        """
        pose = se3.validated(T)
        hint = None if q_hint is None else self.chain.check_q(q_hint)
        return Solutions(self.chain, pose, self.best(pose, hint).tolist(), self.branches)

    def best(self, T: FloatArray, hint: FloatArray | None = None) -> FloatArray:
        """Return the joint angles (8, 7) [rad] of the best swivel of each branch."""
        low, high = float(self.chain.lower[self.swivel]), float(self.chain.upper[self.swivel])
        if is_wide := high - low >= math.tau:
            low, high = -math.pi, math.pi

        def bounded(angles: npt.ArrayLike) -> FloatArray:
            swivels = np.asarray(angles, dtype=np.float64)
            turns = np.round(swivels / math.tau) if is_wide else 0.0
            return np.clip(swivels - math.tau * turns, low, high)

        step = (high - low) / SWIVELS
        swivels = np.linspace(low + 0.5 * step, high - 0.5 * step, SWIVELS)
        if hint is not None:
            # The posture next to the hint may lie where the swivel hardly changes along the curve.
            neighbour = search_of(self.chain).solve(T, hint, seeds=0)
            ends = [hint[self.swivel], neighbour[self.swivel]]
            swivels = np.append(swivels, bounded(ends))
        q = nearest_turn(self.chain, self.at_swivels(T, swivels), hint)
        cost = self._cost(q, T, hint)
        first = q[cost.argmin(axis=0), np.arange(8)]
        least = cost.min(axis=0)
        offsets = np.linspace(-step, step, FINER)
        finer = bounded(first[:, self.swivel, None] + offsets).ravel()
        q = self.at_swivels(T, finer).reshape(8, FINER, 8, 7)
        q = nearest_turn(self.chain, q[np.arange(8), :, np.arange(8)].swapaxes(0, 1), hint)
        cost = self._cost(q, T, hint)
        second = q[cost.argmin(axis=0), np.arange(8)]
        better = cost.min(axis=0) < least
        chosen: FloatArray = np.where(better[:, None], second, first)

        def again(aimed: FloatArray) -> FloatArray:
            branches = np.arange(8)
            return self.at_swivels(aimed, chosen[:, self.swivel])[branches, branches]

        q = self.rounding.corrected(chosen, np.broadcast_to(T, (8, 4, 4)), again)
        return nearest_turn(self.chain, q, hint)

    def _cost(self, q: FloatArray, T: FloatArray, hint: FloatArray | None) -> FloatArray:
        """Return a number (N, 8) for each of `q` (N, 8, 7), least for the best.

        It adds 1000 for a posture that misses the pose and 100 outside of the limits, with the
        excess. Inside it is the room to the limits as a negative fraction, 0.5 at most.
        """
        chain = self.chain
        room = (np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)).min(
            axis=-1
        )
        cost: FloatArray = np.where(room < 0.0, 100.0, 0.0) - room
        if hint is not None:
            cost = cost + CONTINUITY * np.abs(q - hint).max(axis=-1)
        # Forward kinematics take the most time: postures outside of the limits need none at first.
        inside = room >= -tolerances.LIMIT_SLACK
        checked = inside if inside.any(axis=0).all() else np.ones_like(inside)
        distance, turn = errors_of(
            chain, q[checked][:, None], np.broadcast_to(T, (int(checked.sum()), 4, 4))
        )
        off = self.rounding.offset
        exact = (distance <= tolerances.SAME_POSITION + off) & (
            turn <= tolerances.SAME_ROTATION + off
        )
        cost[checked] = np.where(exact[:, 0], cost[checked], 1000.0 + (distance + turn)[:, 0])
        return cost


def _after_first(links: DHLinks, rows: FloatArray, alpha: FloatArray) -> list[list[FloatArray]]:
    """Return the pose `rows` in the frame of axis 2, after axis 1 turned by `alpha` (N,) [rad].

    `rows` are (4, 4), or (N, 4, 4).
    """
    c, s = np.cos(alpha), np.sin(alpha)
    first, second, *others = ([rows[..., i, j] for j in range(4)] for i in range(4))
    turned = [
        [c * x + s * y for x, y in zip(first, second, strict=True)],
        [c * y - s * x for x, y in zip(first, second, strict=True)],
    ]
    whole = [*turned, *([value + 0.0 * c for value in row] for row in others)]
    inverse = se3.inverse(links.link(0))
    return [
        [sum(inverse[i, k] * whole[k][j] for k in range(4)) for j in range(4)] for i in range(4)
    ]
