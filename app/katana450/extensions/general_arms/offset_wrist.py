"""All postures of six axes with an offset wrist, by elimination of all joints but one.

Axes 2 and 3 are parallel, and two of the last three axes meet, in the point W. One joint is locked:

    axis 6 locked    axes 4 and 5 meet (xArm 6, GoFa, Jaco, CRX): the pose and the angle of axis 6
                     give the place of W and the direction of axis 5. The first three axes bring W
                     there, and the angle from axis 4 to axis 5 must be that of the wrist.
    axis 4 locked    axes 5 and 6 meet: the pose gives the place of W and the direction of axis 6,
                     and the angle of axis 4 gives W and the direction of axis 5 after axis 3.

In the plane of axes 2 and 3, with beta the turn of both, c the vector from axis 3 to W and m the
direction after axis 3, and n the direction that the pose gives:

    2 (u, v) . Rz(beta) c = u^2 + v^2 + c^2 - l^2     W is the length l from axis 3 to axis 2
    n . Rz(beta) m = cos(t)                           the angle of the wrist

Both are linear in cos(beta) and sin(beta). That these are a cosine and a sine is one equation for
the locked angle, with two signs of alpha1 (subproblem 4, as in spherical_wrist.py). The product of
both signs is a trigonometric polynomial of degree 8, which 17 samples determine. So its 16 roots,
the eigenvalues of the companion matrix, are all postures: those on the unit circle. A double root
can leave the circle by the square root of rounding, so that all roots near it are tried. Newton's
method then refines the postures on the chain of the file.

Sources: Raghavan and Roth (1993) for the bound of 16 postures; Boyd (2006), Computing the zeros of
a Fourier series, for the roots; Elias and Wen (2022), IK-Geo, for the search over one joint.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.extensions.general_arms.branch_words import ORDINALS, BranchWords
from katana450.extensions.general_arms.functions import Number
from katana450.extensions.general_arms.links import DHLinks, exact_chain, sine_and_cosine
from katana450.extensions.general_arms.numerical import search_of
from katana450.extensions.general_arms.refinement import refined
from katana450.extensions.general_arms.spherical_wrist import wrist_centre
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, IntArray
from katana450.maths.kinematics.batch import chunks, forward_batch
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse_batch import validated_poses
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.solution import Solutions
from katana450.maths.kinematics.turns import in_limits_turns, near_turns, nearest_turn

DEGREE: Final = 8
"""Degree of the trigonometric polynomial: half the maximum number of postures."""

SAMPLES: Final = 32
"""Number of its samples: more than 2 DEGREE + 1 average the rounding."""

CIRCLE_DISTANCE: Final = 0.05
"""[1] Logarithm of the size of a root up to which rounding may have taken it off the circle. Both
sides of such a pair of roots are tried."""

SYMMETRY: Final = 1e-9
"""[1] Relative difference of the equations of both signs of alpha1 that is rounding."""

MAX_MISS: Final = 1e-2
"""[1] Miss of the cosine of the wrist's angle up to which a posture is refined, away from axis 1.
Near it alpha1 magnifies the error of a root."""

CLOSE_DISTANCE: Final = 2e-3
"""[1] Distance of W from axis 1, relative to the reach, below which it passes closely."""

CLOSE_ANGLE: Final = 0.05
"""[rad] Angle from there to a root up to which this counts."""

SPREAD_TURNS: Final = np.linspace(-1.5, 1.5, 61)
"""[rad] Turns of alpha1 from there at which postures are then searched."""

MAX_ERROR: Final = 0.3
"""[rad], [m] Error of the pose up to which a posture is refined."""

NEGLIGIBLE_SIZE: Final = 1e-10
"""[1] Relative size of the last coefficients of the polynomial that are left out. An almost
spherical wrist has small ones, whose zeros are far from the circle."""

EXACT: Final = 9e-13
"""[rad], [m] Error of a posture up to which it takes the pose."""

DISTINCT: Final = 1e-6
"""[rad] Difference of two postures from which on they are two."""


class _Plane(NamedTuple):
    """The two equations in the plane of axes 2 and 3; the module's text defines them.

    Lengths and directions have the shape (2, N, k): signs of alpha1, poses, locked angles.

    Attributes:
        x, y: direction of axis 1's turn, not of unit length.
        u, v: place of W from axis 2 in the plane [m].
        cx, cy: from axis 3 to W at beta = 0 [m].
        position: (a, b, c) of a cos(beta) + b sin(beta) = c for the place of W [m^2].
        wrist: the same for the angle of the wrist, times ``square``.
        square: squared distance of W from axis 1 [m^2].
    """

    x: Number
    y: Number
    u: Number
    v: Number
    cx: Number
    cy: Number
    position: tuple[Number, Number, Number]
    wrist: tuple[Number, Number, Number]
    square: Number


def why_no_offset_wrist(links: DHLinks) -> str:
    """Return the condition that six axes miss; empty if all hold."""
    if not links.is_parallel(2) or links.is_parallel(1) or links.a[1] == 0.0:
        return "axes 2 and 3 are not parallel and apart"
    if links.is_parallel(4) or links.is_parallel(5):
        return "neighbours of axis 5 are parallel to it"
    if not (links.crosses(4) or links.crosses(5)):
        return "neither axes 4 and 5 nor axes 5 and 6 meet"
    return ""


@dataclass(frozen=True, eq=False)
class OffsetWrist(Kinematics):
    """Inverse kinematics of six axes with an offset wrist: all postures of every pose.

    A posture is on one of 8 branches: the side of W from axis 1, the bend of axis 3, and the side
    of the arm's singularity. An arm with an offset wrist can pass from one to another without a
    singularity, and can have several postures on the same one (Wenger 2004, cuspidal robots).

    Attributes:
        chain: the chain.
        links: its dimensions, without the rounding of its file.
    """

    links: DHLinks

    are_separate: ClassVar[bool] = False

    @staticmethod
    def of(chain: Chain, links: DHLinks) -> OffsetWrist | str:
        """Return the kinematics of `chain`, or the condition that it misses."""
        return why_no_offset_wrist(links) or OffsetWrist(chain, links)

    @property
    def locked(self) -> int:
        """Index of the joint that is locked: 5, or 3."""
        return 5 if self.links.crosses(4) else 3

    @property
    def method(self) -> str:
        """The method in words."""
        return f"elimination for six axes with an offset wrist, by axis {self.locked + 1}"

    @cached_property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, see branch_words.py; those of second postures follow the first."""
        # Rounding in the file changes no word.
        exact = exact_chain(self.chain, self.links)
        words = BranchWords(exact, tuple(range(6)), offset=self.locked)
        rng = np.random.default_rng(450)
        q = rng.uniform(-math.pi, math.pi, (512, 6))
        _, places = np.unique(self._numbers(q), return_index=True)
        first = tuple(map(words.of, q[places]))
        return first + tuple(f"{name}-{word}" for word in ORDINALS for name in first)

    def branch_of(self, q: FloatArray) -> str:
        """Return the name of the branch of the joint angles `q` (n,) [rad], without an ordinal."""
        return self.branches[int(self._numbers(q[None])[0])]

    def postures(self, T: FloatArray, near: FloatArray) -> FloatArray:
        """Return `inverse_batch` of one pose, with the posture next to ``near`` if that is free."""
        table: FloatArray = self._table(T[None], near)[0]
        return table

    def on_branch(self, T: FloatArray, branch: AnyBranch, near: FloatArray) -> FloatArray | None:
        """Return the posture (n,) [rad] of ``branch`` for the pose `T` (4, 4), nearest to ``near``.

        Those inside the limits come first. Each angle is in the turn nearest to ``near`` inside its
        limits. None without a posture.
        """
        number = self.branches.index(str(branch))
        rows = self.postures(T, near)[number :: len(self.branches) if number >= 8 else 8]
        candidates = [near_turns(self.chain, q, near) for q in rows if np.isfinite(q[0])]
        return min(
            candidates,
            key=lambda q: (not self.chain.within_limits(q), float(np.abs(q - near).max())),
            default=None,
        )

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return every posture of the pose; see `Kinematics.inverse`.

        A branch without a posture is left out. A pose without any gets the posture to which
        numerical.py leads.
        """
        pose = se3.validated(T)
        hint = None if q_hint is None else self.chain.check_q(q_hint)
        table = self._table(pose[None], hint)[0]
        numbers = np.flatnonzero(np.isfinite(table[:, 0]))
        if not len(numbers):
            q = nearest_turn(self.chain, np.array([search_of(self.chain).solve(pose, hint)]), hint)
            return Solutions(self.chain, pose, q.tolist(), [self.branch_of(q[0])])
        q = nearest_turn(self.chain, table[numbers], hint)
        names = [self.branches[number] for number in numbers.tolist()]
        return Solutions(self.chain, pose, q.tolist(), names)

    def inverse_batch(self, T: npt.ArrayLike) -> FloatArray:
        """Return the joint angles (N, 32, 6) [rad] for poses `T` (N, 4, 4) [m].

        They are not numbers where a branch has no posture. Raises InputError for the first invalid
        pose.
        """
        poses = validated_poses(T)
        table = np.empty((len(poses), len(self.branches), 6))
        for rows in chunks(len(poses)):
            table[rows] = self._table(poses[rows])
        return table

    def _table(self, T: FloatArray, near: FloatArray | None = None) -> FloatArray:
        """Return `inverse_batch` of poses (N, 4, 4), without checks; ``near`` as in `_solved`."""
        pose, number, q = self._solved(T, near)
        table = np.full((len(T), len(self.branches), 6), math.nan)
        order = np.lexsort((q[:, self.locked], number, pose))
        groups = 8 * pose[order] + number[order]
        ordinals = np.arange(len(order)) - np.searchsorted(groups, groups)
        # Singular poses, of which a joint is free, can have more.
        fits = ordinals <= len(ORDINALS)
        order = order[fits]
        table[pose[order], number[order] + 8 * ordinals[fits]] = q[order]
        return table

    def _solved(
        self, T: FloatArray, near: FloatArray | None
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return all postures of poses (N, 4, 4): numbers of pose and branch, and the angles.

        ``near`` (6,) [rad] leads to one of the first pose, where the pose leaves a joint free.
        """
        links = self.links
        rows = links.T_1_S @ T @ links.T_tool_n
        R, place = rows[:, :3, :3], rows[:, :3, 3]
        with np.errstate(all="ignore"):
            origin, theta = self._tried(R, place)
            R = R[origin]
            plane = self._plane(R, place[origin], np.cos(theta), np.sin(theta), _real_root)
            a, b, c = plane.position
            opening = np.arccos(np.clip(c / np.hypot(a, b), -1.0, 1.0))
            beta = np.arctan2(b, a) + np.array((opening, -opening))
            a, b, c = plane.wrist
            missed = np.abs(a * np.cos(beta) + b * np.sin(beta) - c) / plane.square
            near_axis = (tolerances.NEAR_AXIS_1 * links.reach) ** 2 / plane.square
        elbow, side, root, _ = np.nonzero(missed < MAX_MISS * (1.0 + near_axis))
        beta = beta[elbow, side, root, 0]
        x, y, u, v, cx, cy = (
            np.broadcast_to(number, missed.shape[1:])[side, root, 0] for number in plane[:6]
        )
        cos, sin = np.cos(beta), np.sin(beta)
        two = np.arctan2(v - sin * cx - cos * cy, u - cos * cx + sin * cy)
        three = self._flip * (beta - two)
        alpha = self._with_wrist(np.arctan2(y, x), two, three, theta[root, 0], R[root])
        pose, q = origin[root], alpha - links.shift
        if near is not None:
            pose, q = np.append(pose, 0), np.concatenate((q, near[None]))
        postures = refined(self.chain, q, T[pose], MAX_ERROR)
        numbers = self._numbers(postures.q, postures.J)
        places = _distinct(postures.q, postures.error, pose)
        q = in_limits_turns(self.chain, postures.q[places])
        return pose[places], numbers[places], q

    def _with_wrist(
        self,
        one: FloatArray,
        two: FloatArray,
        three: FloatArray,
        theta: FloatArray,
        R: FloatArray,
    ) -> FloatArray:
        """Return the canonical angles (N, 6) with those of the wrist: subproblem 1, twice.

        Two joints turn what the others leave of the rotation `R` (N, 3, 3).
        """
        L = self._rotations
        arm = _turned(one) @ L[0] @ _turned(two) @ L[1] @ _turned(three) @ L[2]
        if self.locked == 5:
            left, (sine, _) = arm.swapaxes(1, 2) @ R @ _turned(-theta) @ L[4].T, self._twists[3]
        else:
            arm, (sine, _) = arm @ _turned(theta) @ L[3], self._twists[4]
            left = arm.swapaxes(1, 2) @ R
        first = np.arctan2(left[:, 0, 2] / sine, -left[:, 1, 2] / sine)
        second = np.arctan2(left[:, 2, 0] / sine, left[:, 2, 1] / sine)
        wrist = (first, second, theta) if self.locked == 5 else (theta, first, second)
        return np.stack((one, two, three, *wrist), axis=1)

    def _tried(self, R: FloatArray, place: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return poses (M,) and locked angles (M, 1) [rad] at which postures are searched.

        They are the `_roots`. Where these lead W past axis 1 closely, they are known poorly, and
        alpha1 turns by half a turn at once: then angles are added over which it is spread.
        """
        roots = self._roots(R, place)
        pose, root = np.nonzero(np.isfinite(roots))
        theta = roots[pose, root]
        if self.locked == 3:
            return pose, theta[:, None]
        cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
        x, y, _ = _mapped(R[pose], _around(cos, -sin, self._centre_in_tool), place[pose])
        wx, wy, _ = self._centre_in_tool
        dx, dy, _ = _mapped(R[pose], _around(-sin, -cos, (wx, wy, 0.0)))
        square = dx * dx + dy * dy
        passing, offset = np.abs(x * dy - y * dx) / square, -(x * dx + y * dy) / square
        is_close = (passing * np.sqrt(square) < CLOSE_DISTANCE * self.links.reach) & (
            np.abs(offset) < CLOSE_ANGLE
        )
        passes = np.flatnonzero(is_close)
        _, first = np.unique(pose[passes], return_index=True)
        passes = passes[first]
        spread = (theta[:, None] + offset)[passes] + passing[passes] * np.tan(SPREAD_TURNS)
        origin = np.concatenate((pose, np.repeat(pose[passes], len(SPREAD_TURNS))))
        return origin, np.concatenate((theta, spread.ravel()))[:, None]

    def _roots(self, R: FloatArray, place: FloatArray) -> FloatArray:
        """Return the locked angles (N, 16) [rad] that may give postures.

        They are for the rotations (N, 3, 3) and places (N, 3) of the last frame in the first.
        """
        angles = np.arange(2 * SAMPLES) * (0.5 * math.tau / SAMPLES)
        plane = self._plane(R, place, np.cos(angles), np.sin(angles), _complex_root)
        (a, b, c), (a2, b2, c2) = plane.position, plane.wrist
        squares = (c * b2 - c2 * b) ** 2 + (a * c2 - a2 * c) ** 2 - (a * b2 - a2 * b) ** 2
        # Samples with W near axis 1 have large rounding: every other one is used.
        square = np.broadcast_to(plane.square, squares.shape[1:]).reshape(-1, SAMPLES, 2)
        half = square.min(axis=1).argmax(axis=1)
        pairs = (squares / plane.square).reshape(2, -1, SAMPLES, 2)
        front, back = np.take_along_axis(pairs, half[None, :, None, None], axis=3)[..., 0]
        if np.abs(front - back).max() <= SYMMETRY * np.abs(front).max():
            # Each root has the posture in front of axis 1 and the same one turned about it.
            back = np.ones_like(front)
        values = (front * back).real
        orders = np.arange(-DEGREE, DEGREE + 1)
        turn = np.exp(-1j * (0.5 * math.tau / SAMPLES) * half[:, None] * orders) / SAMPLES
        coefficients = np.fft.fft(values)[:, orders] * turn
        sizes = np.abs(coefficients[:, DEGREE:])
        counts = np.where(
            sizes > NEGLIGIBLE_SIZE * sizes.max(axis=1, keepdims=True), orders[DEGREE:], 0
        )
        theta = np.full((len(values), 2 * DEGREE), math.nan)
        degrees = counts.max(axis=1)
        for degree in np.unique(degrees[degrees > 0]).tolist():
            rows = degrees == degree
            series = coefficients[rows, DEGREE - degree : DEGREE + degree + 1]
            theta[rows, : 2 * degree] = _angles_of_zeros(series)
        return theta

    def _plane(
        self,
        R: FloatArray,
        place: FloatArray,
        cos: FloatArray,
        sin: FloatArray,
        root: Callable[[FloatArray], Number],
    ) -> _Plane:
        """Return the equations at the locked angles, given by ``cos`` and ``sin`` (k,) or (N, k).

        They are for the rotations (N, 3, 3) and places (N, 3) of the last frame in the first.
        """
        links, flip = self.links, self._flip
        (s1, c1), _, (s3, c3), (s4, c4), (s5, c5) = self._twists
        if self.locked == 5:
            cx, cy, cz = wrist_centre(links)
            # From axis 6, W and axis 5.
            x, y, z = _mapped(R, _around(cos, -sin, self._centre_in_tool), place)
            n1, n2, n3 = _mapped(R, _around(cos, -sin, (0.0, s5, c5)))
            m1, m2, m3, cosine = 0.0, -s3, c3, c4
        else:
            x, y, z = place.T[:, :, None]
            n1, n2, n3 = R[:, :, 2].T[:, :, None]
            cx, cy, cz = self._centre(cos, sin)
            m1, wy, wz = _around(cos, sin, (0.0, -s4, c4))
            m2, m3, cosine = c3 * wy - s3 * wz, s3 * wy + c3 * wz, c5
        z = z - links.d[0]
        side = (c1 * z - links.d[1] - flip * cz) / s1
        square = x * x + y * y
        length = root(square - side * side)
        length = np.array((length, -length))
        u, v = length - links.a[0], c1 * side + s1 * z
        turn_x, turn_y = x * length + y * side, y * length - x * side
        cy, m2, m3 = flip * cy, flip * m2, flip * m3
        p1, across = turn_x * n1 + turn_y * n2, turn_x * n2 - turn_y * n1
        p2, p3 = c1 * across + s1 * n3 * square, c1 * n3 * square - s1 * across
        excess = u * u + v * v + cx * cx + cy * cy - links.a[1] ** 2
        return _Plane(
            turn_x, turn_y, u, v, cx, cy,
            (2.0 * (u * cx + v * cy), 2.0 * (v * cx - u * cy), excess),
            (p1 * m1 + p2 * m2, p2 * m1 - p1 * m2, cosine * square - p3 * m3),
            square,
        )  # fmt: skip

    def _centre(self, cos: FloatArray, sin: FloatArray) -> tuple[Number, Number, Number]:
        """Return the place of W [m] in the frame of axis 3, at angles of axis 4."""
        links, ((s3, c3), (s4, c4)) = self.links, self._twists[2:4]
        d5 = links.d[4]
        x, y, z = _around(cos, sin, (links.a[3], -s4 * d5, links.d[3] + c4 * d5))
        return links.a[2] + x, c3 * y - s3 * z, links.d[2] + s3 * y + c3 * z

    @cached_property
    def _centre_in_tool(self) -> tuple[float, float, float]:
        """The place of W [m] in the last frame, before the turn of axis 6."""
        (s5, c5), d5 = self._twists[4], self.links.d[4]
        return -self.links.a[4], -s5 * d5, -c5 * d5

    @cached_property
    def _twists(self) -> tuple[tuple[float, float], ...]:
        return tuple(map(sine_and_cosine, self.links.t))

    @cached_property
    def _rotations(self) -> list[FloatArray]:
        """The rotations (3, 3) of the links."""
        return [self.links.link(k)[:3, :3] for k in range(5)]

    @property
    def _flip(self) -> float:
        """1 if axes 2 and 3 have the same direction, else -1."""
        return self._twists[1][1]

    def _numbers(self, q: FloatArray, J: FloatArray | None = None) -> IntArray:
        """Return the numbers (N,) of the branches of joint angles `q` (N, 6) [rad].

        `J` (N, 6, 6) is the Jacobian in any frame. The three signs are those of branch_words.py.
        """
        if J is None:
            J = refined(self.chain, q, forward_batch(self.chain, q), 0.0).J
        links, flip = self.links, self._flip
        alpha = q + links.shift
        two, beta = alpha[:, 1], alpha[:, 1] + flip * alpha[:, 2]
        cx, cy, _ = wrist_centre(links)
        if self.locked == 3:
            cx, cy, _ = self._centre(np.cos(alpha[:, 3]), np.sin(alpha[:, 3]))
        cos, sin = np.cos(beta), np.sin(beta)
        out, up = cos * cx - flip * sin * cy, sin * cx + flip * cos * cy
        length = links.a[0] + links.a[1] * np.cos(two) + out
        bend = np.cos(two) * up - np.sin(two) * out
        wrist = np.linalg.det(J) * length * bend
        numbers: IntArray = 4 * (length < 0.0) + 2 * (bend < 0.0) + (wrist < 0.0)
        return numbers


def _real_root(x: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(x, 0.0))


def _complex_root(x: FloatArray) -> npt.NDArray[np.complex128]:
    return np.sqrt(x.astype(np.complex128))


def _around(cos: FloatArray, sin: FloatArray, vector: tuple[float, float, float]) -> list[Number]:
    """Return the components of a vector that is turned about z."""
    x, y, z = vector
    return [cos * x - sin * y, sin * x + cos * y, z]


def _mapped(R: FloatArray, vector: list[Number], place: FloatArray | None = None) -> list[Number]:
    """Return the components (N, k) of a vector after the rotations `R` (N, 3, 3), from `place`."""
    x, y, z = vector
    rows = [R[:, i, 0, None] * x + R[:, i, 1, None] * y + R[:, i, 2, None] * z for i in range(3)]
    return rows if place is None else [row + place[:, i, None] for i, row in enumerate(rows)]


def _turned(theta: FloatArray) -> FloatArray:
    """Return the rotations (N, 3, 3) about z by angles (N,) [rad]."""
    R = np.zeros((len(theta), 3, 3))
    R[:, 0, 0] = R[:, 1, 1] = np.cos(theta)
    R[:, 1, 0] = np.sin(theta)
    R[:, 0, 1] = -R[:, 1, 0]
    R[:, 2, 2] = 1.0
    return R


def _angles_of_zeros(coefficients: npt.NDArray[np.complex128]) -> FloatArray:
    """Return the angles (N, m) [rad] at and near the zeros of Fourier series (N, m + 1).

    A series begins with its lowest order. A zero near the unit circle comes as a pair of the same
    angle, on both sides of which the angles are. Other zeros have none.
    """
    count = coefficients.shape[1] - 1
    companion = np.zeros((len(coefficients), count, count), dtype=np.complex128)
    companion[:, np.arange(1, count), np.arange(count - 1)] = 1.0
    companion[:, :, -1] = -coefficients[:, :-1] / coefficients[:, -1:]
    zeros = np.linalg.eigvals(companion)
    distance = np.log(np.abs(zeros))
    angles: FloatArray = np.angle(zeros) + distance
    angles[np.abs(distance) > CIRCLE_DISTANCE] = math.nan
    return angles


def _distinct(q: FloatArray, error: FloatArray, pose: IntArray) -> list[int]:
    """Return the places of the exact and different postures among `q` (N, 6) [rad], by pose."""
    places: dict[int, list[int]] = {}
    for k in np.argsort(error, kind="stable").tolist():
        if error[k] > EXACT:
            break
        others = places.setdefault(int(pose[k]), [])
        turns = q[others] - q[k]
        turns -= math.tau * np.round(turns / math.tau)
        if not (np.abs(turns).max(axis=1) < DISTINCT).any():
            others.append(k)
    return [place for others in places.values() for place in others]
