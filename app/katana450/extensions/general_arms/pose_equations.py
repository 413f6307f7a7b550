"""The equations between the joints and a pose of the tool, which a path solves at every place.

There are as many as joints that are not locked: three for the tool point, and those of the
rotation. From six axes on these are all three components of the rotation from the tool to the pose.
With n < 6 axes they are its components about the last n - 3 axes, and the pose turns with axis 1.
Of more than six axes the joints ``locked`` are given, such as the one that sets the arm angle.

Derivatives come from the same equations on jets. With the exact angles and the matrix of the
equations at one place, each step of Newton's method makes one more derivative exact (Griewank and
Walther, Evaluating Derivatives, 2008, ch. 13).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.general_arms.descent import Descent, Look, Regularity, descent_of
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import jacobian_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet, sin_cos
from katana450.maths.planning.posture import JointJets, ThreeJets, ToolJets

PASSES: Final = 5
"""Number of steps on jets: angles and three derivatives, and one to spare."""

LOOSE_PASSES: Final = 20
"""The number for arms whose orientation is only the nearest: the steps then converge linearly."""

STEPS, LOOSE_STEPS = 8, 40
"""Maximum numbers of steps at one place; see `PoseEquations.is_exact`."""

SOLVED: Final = 1e-12
"""[rad] Step after which a posture counts as exact."""

WILD: Final = 1.0
"""[rad] Step after which the method is given up."""


class RegularPosture(NamedTuple):
    """A posture that takes a pose.

    Attributes:
        q: (n,) joint angles [rad].
        matrix: the matrix that decides its branch, see `Regularity`.
        least: its smallest singular value.
    """

    q: FloatArray
    matrix: FloatArray
    least: float


Vector = tuple[Jet | float, Jet | float, Jet | float]


@dataclass(frozen=True, eq=False)
class PoseEquations:
    """The equations of one arm.

    Attributes:
        descent: the search of the arm, which looks at single postures.
        locked: indices of the joints that are given.
    """

    descent: Descent
    locked: tuple[int, ...] = ()

    @property
    def chain(self) -> Chain:
        """The chain, to the tool."""
        return self.descent.search.chain

    @property
    def length(self) -> float:
        """The length [m] by which translations are divided."""
        return self.descent.search.length

    @cached_property
    def free(self) -> list[int]:
        """Indices of the joints that are solved for."""
        return [k for k in range(self.chain.n) if k not in self.locked]

    @property
    def is_exact(self) -> bool:
        """True if the arm can keep its orientation along every path: not with 3 or 5 axes."""
        return self.chain.n >= 6 or self.chain.n == 4

    @cached_property
    def _turning(self) -> range:
        """Indices of the axes about which fewer than six axes turn the tool."""
        return range(3, self.chain.n)

    def _axes(self, q: FloatArray) -> FloatArray:
        """Return the axes (N, 6, n) at joint angles `q` (N, n) [rad], in {S}.

        An axis has its direction, and the velocity [m/rad] that it gives to the tool point.
        """
        T, J = jacobian_batch(self.chain, q)
        R = T[:, None, :3, :3]
        return (R @ J.reshape(len(q), 2, 3, -1)).reshape(J.shape)

    def _matrix(self, q: FloatArray) -> FloatArray:
        """Return the matrix (N, m, m) of the equations at `q` (N, n) [rad]; lengths in `length`."""
        axes = self._axes(q)
        J = axes[:, :, self.free].copy()
        J[:, 3:] /= self.length
        if self.chain.n >= 6:
            return J
        J[:, :3, 0] = 0.0
        turns = axes[:, :3, self._turning]
        return np.concatenate((turns.swapaxes(1, 2) @ J[:, :3], J[:, 3:]), axis=1)

    def least(self, q: FloatArray) -> float:
        """Return the smallest singular value of the deciding matrix at `q` (n,) [rad]."""
        goal = self.descent.goal(ToolTarget.of(np.eye(4)))
        return Regularity.least(self._linear(self.descent.look(goal, tuple(q.tolist())))[2])

    def posture(self, q: FloatArray, wanted: FloatArray) -> RegularPosture | None:
        """Return the posture near `q` (n,) [rad] for the pose ``wanted`` (4, 4).

        None if Newton's method does not lead there.
        """
        goal = self.descent.goal(ToolTarget.of(wanted))
        angles = q.tolist()
        for _ in range(STEPS if self.is_exact else LOOSE_STEPS):
            look = self.descent.look(goal, tuple(angles))
            A, error, deciding = self._linear(look)
            try:
                turns = np.linalg.solve(A, error).tolist()
            except np.linalg.LinAlgError:
                return None
            for k, turn in zip(self.free, turns, strict=True):
                angles[k] += turn
            size = max(map(abs, turns))
            if size <= SOLVED:
                return RegularPosture(np.array(angles), deciding, Regularity.least(deciding))
            if not size <= WILD:
                return None
        return None

    def _linear(self, look: Look) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return matrix (m, m) and right side (m,) of a step, and the matrix that decides."""
        J = look.J[self.free].T
        if self.chain.n >= 6:
            return J, look.error, J
        turns = look.J[3:, :3]
        A = np.concatenate((turns @ J[:3], J[3:]))
        return A, np.concatenate((turns @ look.error[:3], look.error[3:])), look.matrix

    def solved(self, q: FloatArray, locked_jets: Sequence[Jet], pose: ToolJets) -> JointJets:
        """Return the joints as jets at N places of a curve of poses, from angles `q` (N, n) [rad].

        ``locked_jets``: the locked joints. The angles may be off by little.
        """
        inverse = np.linalg.inv(self._matrix(q))
        zeros = np.zeros(len(q))
        joints = [Jet(jet, zeros, zeros, zeros) for jet in q.T]
        for k, jet in zip(self.locked, locked_jets, strict=True):
            joints[k] = jet
        for _ in range(PASSES if self.is_exact else LOOSE_PASSES):
            lacking = self._lacking(joints, pose)
            orders = [
                np.stack([np.broadcast_to(row, zeros.shape) for row in rows], axis=1)
                for rows in zip(*((e.c0, e.c1, e.c2, e.c3) for e in lacking), strict=True)
            ]
            turns = [(inverse @ order[:, :, None])[:, :, 0] for order in orders]
            for place, k in enumerate(self.free):
                joints[k] = joints[k] + Jet(*(turn[:, place] for turn in turns))
        return tuple(joints)

    def _lacking(self, q: Sequence[Jet], pose: ToolJets) -> list[Jet]:
        """Return what the joints lack of ``pose``, as m jets."""
        point, columns, turning = self._moved(q)
        assert pose.columns is not None
        target: Sequence[Vector] = pose.columns
        if self.chain.n < 6:
            s, c = sin_cos(q[0])
            w = tuple(self.chain.S[:3, 0].tolist())
            target = [_turned(column, w, s, 1.0 - c) for column in target]
        x, y, z = (
            0.5 * sum(crossed[k] for crossed in map(_cross, columns, target)) for k in range(3)
        )
        rotation: list[Jet] = [x, y, z]  # type: ignore[list-item]
        if self.chain.n < 6:
            rotation = [a * x + b * y + c * z for a, b, c in turning]
        place = [(b - a) * (1.0 / self.length) for a, b in zip(point, pose[:3], strict=True)]
        return [*rotation, *place]

    def _moved(self, q: Sequence[Jet]) -> tuple[ThreeJets, list[ThreeJets], list[ThreeJets]]:
        """Return the tool point, the columns of its rotation, and the axes that turn it, as jets.

        The product of exponentials acts on them from the tool to the base, as in
        `posture.point_by_exponentials`.
        """
        chain = self.chain
        x, y, z = (Jet.constant(number) for number in chain.M[:3, 3].tolist())
        moved: list[Vector] = [tuple(column) for column in chain.M[:3, :3].T.tolist()]
        for k in range(chain.n - 1, -1, -1):
            wx, wy, wz, vx, vy, vz = chain.S[:, k].tolist()
            w = wx, wy, wz
            s, c = sin_cos(q[k])
            s = q[k] if chain.slides[k] else s
            versine = 1.0 - c
            ax, ay, az = wy * z - wz * y + vx, wz * x - wx * z + vy, wx * y - wy * x + vz
            x = x + s * ax + versine * (wy * az - wz * ay)
            y = y + s * ay + versine * (wz * ax - wx * az)
            z = z + s * az + versine * (wx * ay - wy * ax)
            moved = [_turned(column, w, s, versine) for column in moved]
            if chain.n < 6 and k in self._turning:
                moved.append(w)
        return (x, y, z), moved[:3], moved[3:][::-1]  # type: ignore[return-value]


def equations_from(solver: Kinematics, q: FloatArray, joint: int | None = None) -> PoseEquations:
    """Return the equations of a path of the tool that begins at `q` (n,) [rad].

    Of more than six axes ``joint`` is locked, or the one that sets the arm angle, or the joints
    without which the others move the tool best.
    """
    locked = solver.arm_angle_joint if joint is None else joint
    equations = PoseEquations(descent_of(solver), () if locked is None else (locked,))
    while len(equations.free) > 6:
        rest = [replace(equations, locked=(*equations.locked, k)) for k in equations.free]
        equations = max(rest, key=lambda candidate: candidate.least(q))
    return equations


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _turned(v: Vector, w: Sequence[float], s: Jet, versine: Jet) -> Vector:
    """Return ``v`` turned about the unit vector ``w``; ``versine`` is 1 - cosine."""
    wx, wy, wz = w
    x, y, z = v
    ax, ay, az = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    return (
        x + s * ax + versine * (wy * az - wz * ay),
        y + s * ay + versine * (wz * ax - wx * az),
        z + s * az + versine * (wx * ay - wy * ax),
    )
