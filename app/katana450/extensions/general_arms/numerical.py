"""Numerical inverse kinematics for every chain of joints that turn or slide, within its limits.

A step minimises |J dq - e|^2 + mu |dq|^2, where e is the twist from the tool to the target with its
translation divided by the length of the arm: a damped Gauss-Newton step. The damping mu falls with
each step that comes nearer and rises with each that does not (Levenberg 1944, Marquardt 1963). A
joint that the step pushes beyond its limit stays there, and the others take the step without it.

Seeds: the given posture; then those of a fixed table of postures inside the limits whose poses are
nearest to the target. A target that no seed reaches gets the posture with the least error.

Speed: one target at a time is computed on plain floats; numpy solves the 6 equations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.extensions.general_arms.links import DHLinks, links_of, sine_and_cosine
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.solution import Solutions
from katana450.maths.kinematics.turns import in_limits_turns, nearest_turn

Motion = tuple[tuple[float, ...], list[tuple[float, float, float, float, float, float]]]
"""Pose and axes as `tool_and_jacobian` returns them."""


def tool_and_jacobian(
    links: DHLinks,
) -> Callable[[Sequence[float]], Motion]:
    """Return state(q) on plain floats: the tool's rotation and place, and the joints' axes.

    The first value has 12 numbers: the rotation by columns, then the place [m]. Each axis has 6:
    its direction, and the velocity [m/rad] that it gives to the tool point. All are in the frame of
    axis 1.
    """
    n = links.n
    steps = [
        (
            bool(links.slides) and links.slides[i],
            links.shift[i],
            *(
                (links.a[i], links.d[i], *sine_and_cosine(links.t[i]), links.b[i])
                if i < n - 1
                else (0.0, 0.0, 0.0, 1.0, 0.0)
            ),
        )
        for i in range(n)
    ]
    tool = links.T_n_tool
    (t11, t12, t13, tx), (t21, t22, t23, ty), (t31, t32, t33, tz) = tool[:3].tolist()
    cos, sin = math.cos, math.sin
    sliding = [k for k, slides in enumerate(links.slides) if slides]

    def state(q: Sequence[float]) -> Motion:
        xx, xy, xz, yx, yy, yz, zx, zy, zz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
        px = py = pz = 0.0
        axes = []
        for theta, (slides, shift, a, d, st, ct, tilt) in zip(q, steps, strict=True):
            axes.append((zx, zy, zz, px, py, pz))
            if slides:
                px, py, pz = px + theta * zx, py + theta * zy, pz + theta * zz
                theta = 0.0  # noqa: PLW2901
            c, s = cos(theta + shift), sin(theta + shift)
            xx, yx = c * xx + s * yx, c * yx - s * xx
            xy, yy = c * xy + s * yy, c * yy - s * xy
            xz, yz = c * xz + s * yz, c * yz - s * xz
            if d:
                px, py, pz = px + d * zx, py + d * zy, pz + d * zz
            if a:
                px, py, pz = px + a * xx, py + a * xy, pz + a * xz
            if st:
                yx, zx = ct * yx + st * zx, ct * zx - st * yx
                yy, zy = ct * yy + st * zy, ct * zy - st * yy
                yz, zz = ct * yz + st * zz, ct * zz - st * yz
            elif ct < 0.0:
                yx, yy, yz, zx, zy, zz = -yx, -yy, -yz, -zx, -zy, -zz
            if tilt:
                c, s = cos(tilt), sin(tilt)
                xx, zx = c * xx - s * zx, c * zx + s * xx
                xy, zy = c * xy - s * zy, c * zy + s * xy
                xz, zz = c * xz - s * zz, c * zz + s * xz
        px, py, pz = (
            px + tx * xx + ty * yx + tz * zx,
            py + tx * xy + ty * yy + tz * zy,
            pz + tx * xz + ty * yz + tz * zz,
        )
        pose = (
            t11 * xx + t21 * yx + t31 * zx, t11 * xy + t21 * yy + t31 * zy,
            t11 * xz + t21 * yz + t31 * zz,
            t12 * xx + t22 * yx + t32 * zx, t12 * xy + t22 * yy + t32 * zy,
            t12 * xz + t22 * yz + t32 * zz,
            t13 * xx + t23 * yx + t33 * zx, t13 * xy + t23 * yy + t33 * zy,
            t13 * xz + t23 * yz + t33 * zz,
            px, py, pz,
        )  # fmt: skip
        moved = []
        for ax, ay, az, ox, oy, oz in axes:
            rx, ry, rz = px - ox, py - oy, pz - oz
            moved.append((ax, ay, az, ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx))
        for k in sliding:
            moved[k] = (0.0, 0.0, 0.0, *axes[k][:3])
        return pose, moved

    return state


QUICK_STEPS: Final = 14
"""Maximum number of steps from one seed. Most seeds that lead to the target need fewer."""

STEPS: Final = 100
"""Maximum number of steps from the best end, if no seed leads to the target."""

SEEDS: Final = 60
"""Maximum number of seeds for a target."""

FEW_SEEDS, FEW_ENDS = 12, 3
"""Numbers of seeds, and of their best ends, from which the nearest posture is searched."""

TABLE: Final = 4096
"""Number of postures from which the seeds are taken."""

SOLVED: Final = 1e-11
"""[rad], [arm lengths] Error at which a target counts as reached."""

LARGEST_STEP: Final = 1.0
"""[rad] Maximum turn of a joint in one step."""

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-14, 1e3

STALLED: Final = 1e-3
"""[1] Relative gain of a step below which the search ends, away from the target."""


class SearchState(NamedTuple):
    """The state of an arm: error, its squared size, and Jacobian as the six rows of a list."""

    error: tuple[float, ...]
    square: float
    J: list[list[float]]


@dataclass(frozen=True, eq=False)
class Numerical(Kinematics):
    """Numerical inverse kinematics of one chain; the module's text describes the method.

    Attributes:
        chain: the chain.
        links: its dimensions.
        why: the reason why no closed form is used, as a clause.
        weight: weight of the position beside the orientation.
    """

    links: DHLinks
    why: str = ""
    weight: float = 1.0

    branches: ClassVar[tuple[str, ...]] = ("numerical",)

    @property
    def method(self) -> str:
        """The method in words."""
        return f"numerical{self.why and f', because {self.why}'}"

    def postures(self, T: FloatArray, near: FloatArray) -> None:  # noqa: ARG002
        """Return None: a search tells no branches apart."""
        return

    @cached_property
    def length(self) -> float:
        """The length [m] by which translations are divided."""
        return max(0.5 * self.links.reach, 1e-3) / self.weight

    @cached_property
    def motion(self) -> Callable[[Sequence[float]], Motion]:
        """`tool_and_jacobian` of the links."""
        return tool_and_jacobian(self.links)

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Postures (TABLE, n) [rad] inside the limits, and their poses as rows (TABLE, 12)."""
        chain = self.chain
        rng = np.random.default_rng(chain.n)
        q = rng.uniform(chain.lower, chain.upper, (TABLE, chain.n))
        q[0] = 0.5 * (chain.lower + chain.upper)
        return q, self._places(forward_batch(chain, q))

    def _places(self, T: FloatArray) -> FloatArray:
        """Return poses (N, 4, 4) as rows (N, 12), whose distances compare rotations and places."""
        R = T[:, :3, :3].reshape(-1, 9) * math.sqrt(0.5)
        return np.concatenate((R, T[:, :3, 3] / self.length), axis=1)

    def seeds(self, T: FloatArray) -> FloatArray:
        """Return the postures (SEEDS, n) [rad] of the table, those with poses nearest to `T`."""
        q, places = self._table
        far = ((places - self._places(T[None])) ** 2).sum(axis=1)
        nearest = np.argpartition(far, SEEDS)[:SEEDS]
        return q[nearest[np.argsort(far[nearest], kind="stable")]]

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return one posture inside the limits; see `Kinematics.inverse`.

        The search begins at `q_hint` (n,) [rad]. If no seed reaches the pose, the posture is the
        nearest that was found.
        """
        pose = se3.validated(T)
        hint = None if q_hint is None else self.chain.clamp(q_hint)
        q = nearest_turn(self.chain, np.array(self.solve(pose, hint)), hint)
        return Solutions(self.chain, pose, [tuple(q.tolist())], self.branches)

    def solve(
        self, T: FloatArray, hint: FloatArray | None = None, seeds: int = SEEDS
    ) -> tuple[float, ...]:
        """Return the joint angles [rad] nearest to the pose `T` (4, 4), without checks."""
        goal = self.goal(T)
        best: tuple[float, ...] = ()
        least = math.inf
        for start in self._starts(T, hint, seeds):
            q, square = self.descend(goal, start, QUICK_STEPS)
            if square < least:
                best, least = q, square
            if least <= SOLVED * SOLVED:
                break
        else:
            best, _ = self.descend(goal, best, STEPS)
        return tuple(in_limits_turns(self.chain, np.array(best)).tolist())

    def _starts(
        self, T: FloatArray, hint: FloatArray | None, seeds: int
    ) -> Iterator[Sequence[float]]:
        if hint is not None:
            yield hint.tolist()
        if seeds:
            yield from self.seeds(T)[:seeds].tolist()

    def nearest(self, T: FloatArray, starts: Sequence[FloatArray], weight: float) -> FloatArray:
        """Return the joint angles (n,) [rad] inside the limits with the least error for `T` (4, 4).

        The error of the position counts ``weight`` times as much as in `solve`. The search begins
        at `starts` and at the seeds.
        """
        search = replace(self, weight=weight)
        goal = search.goal(T)
        first_ends = [search.descend(goal, start.tolist(), QUICK_STEPS) for start in starts]
        first_ends += [
            search.descend(goal, start, QUICK_STEPS) for start in self.seeds(T)[:FEW_SEEDS].tolist()
        ]
        ends = [
            search.descend(goal, q, STEPS)
            for q, _ in sorted(first_ends, key=lambda end: end[1])[:FEW_ENDS]
        ]
        q, _ = min(ends, key=lambda end: end[1])
        return in_limits_turns(self.chain, np.array(q))

    def goal(self, T: FloatArray) -> tuple[float, ...]:
        """Return `T` in the frame of axis 1: the rotation by columns, then the place."""
        pose = self.links.T_1_S @ T
        return (*pose[:3, :3].T.ravel().tolist(), *pose[:3, 3].tolist())

    def step(self, goal: tuple[float, ...], q: Sequence[float]) -> SearchState:
        """Return error and Jacobian at `q` [rad], translations divided by `length`."""
        pose, moved = self.motion(q)
        scale = 1.0 / self.length
        error = (
            *_turn(pose, goal),
            *((b - a) * scale for a, b in zip(pose[9:], goal[9:], strict=True)),
        )
        J = [[w1, w2, w3, v1 * scale, v2 * scale, v3 * scale] for w1, w2, w3, v1, v2, v3 in moved]
        return SearchState(error, math.fsum(e * e for e in error), J)

    def descend(
        self, goal: tuple[float, ...], start: Sequence[float], steps: int
    ) -> tuple[tuple[float, ...], float]:
        """Return the joint angles [rad] to which steps from `start` lead, and the squared error."""
        lower, upper = self._limits
        q = [min(max(x, a), b) for x, a, b in zip(start, lower, upper, strict=True)]
        now = self.step(goal, q)
        mu, slow = FIRST_DAMPING, 0
        for _ in range(steps):
            if now.square <= SOLVED * SOLVED:
                break
            dq = self._turned(now, q, mu)
            candidate = [
                min(max(x + d, a), b) for x, d, a, b in zip(q, dq, lower, upper, strict=True)
            ]
            then = self.step(goal, candidate)
            if then.square < now.square:
                slow = slow + 1 if then.square > (1.0 - STALLED) * now.square else 0
                q, now = candidate, then
                mu = max(0.1 * mu, LEAST_DAMPING)
                if slow == 3:
                    break
            else:
                mu *= 8.0
                if mu > MOST_DAMPING:
                    break
        return tuple(q), now.square

    @cached_property
    def _limits(self) -> tuple[list[float], list[float]]:
        """The limits [rad] that a search keeps: none for a joint that can take every direction."""
        ends = list(zip(self.chain.lower.tolist(), self.chain.upper.tolist(), strict=True))
        whole = [
            b - a >= math.tau - tolerances.LIMIT_SLACK and not slides
            for (a, b), slides in zip(ends, self.chain.slides, strict=True)
        ]
        return (
            [-math.inf if w else a for (a, _), w in zip(ends, whole, strict=True)],
            [math.inf if w else b for (_, b), w in zip(ends, whole, strict=True)],
        )

    def _turned(self, now: SearchState, q: list[float], mu: float) -> list[float]:
        """Return the damped step (n,) [rad]; joints that it pushes beyond a limit are left out."""
        lower, upper = self._limits
        J, error = np.array(now.J), np.array(now.error)
        damping = mu * max(now.square, 1e-18) if mu < 1.0 else mu
        for _ in range(self.chain.n):
            A = J.T @ J
            A.flat[::7] += damping + 1e-15
            dq: list[float] = (J @ np.linalg.solve(A, error)).tolist()
            pushed = [
                k
                for k, (x, d, a, b) in enumerate(zip(q, dq, lower, upper, strict=True))
                if (x <= a and d < 0.0) or (x >= b and d > 0.0)
            ]
            if not pushed:
                break
            J[pushed] = 0.0
        largest = max(map(abs, dq))
        if largest > LARGEST_STEP:
            dq = [d * LARGEST_STEP / largest for d in dq]
        return dq


def _turn(pose: tuple[float, ...], goal: tuple[float, ...]) -> tuple[float, float, float]:
    """Return the rotation vector [rad] from the first nine numbers of `pose` to those of `goal`.

    Half the sum of x x x', y x y', z x z' is its axis times its sine.
    """
    a, b, c, d, e, f, g, h, i, *_ = pose
    j, k, m, n, o, p, r, s, t, *_ = goal
    x = 0.5 * (b * m - c * k + e * p - f * o + h * t - i * s)
    y = 0.5 * (c * j - a * m + f * n - d * p + i * r - g * t)
    z = 0.5 * (a * k - b * j + d * o - e * n + g * s - h * r)
    sine = math.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (a * j + b * k + c * m + d * n + e * o + f * p + g * r + h * s + i * t - 1.0)
    if cosine < -0.99:
        first, second = (np.reshape(numbers[:9], (3, 3)).T for numbers in (pose, goal))
        w: list[float] = so3.log(second @ first.T).tolist()
        return w[0], w[1], w[2]
    factor = math.atan2(sine, cosine) / sine if sine > 1e-12 else 1.0
    return factor * x, factor * y, factor * z


@lru_cache(maxsize=64)
def search_of(chain: Chain) -> Numerical:
    """Return the search of ``chain`` as its file describes it; the result is cached."""
    return Numerical(chain, links_of(chain, exact=False))
