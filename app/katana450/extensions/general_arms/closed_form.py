"""Inverse kinematics in closed form of arms with four or six axes, and of whole arrays of poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.caching import cached_property
from katana450.extensions.general_arms.branch_words import BranchWords
from katana450.extensions.general_arms.functions import ARRAYS, FLOATS, Operations
from katana450.extensions.general_arms.links import DHLinks
from katana450.extensions.general_arms.parallel_axes import (
    LOOSE,
    four_axes,
    pointed,
    six_axes,
    why_not_parallel,
)
from katana450.extensions.general_arms.refinement import FileRounding
from katana450.extensions.general_arms.spherical_wrist import (
    Solve,
    crossing_shoulder,
    is_crossing_shoulder,
    is_parallel_shoulder,
    parallel_shoulder,
    why_not_spherical,
)
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse_batch import validated_poses
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.solution import Angles, Solutions
from katana450.maths.kinematics.turns import (
    another_turn_helps,
    in_limits_turns,
    in_turn,
    nearest_turn,
)


class Form(NamedTuple):
    """A closed form that solves certain links.

    Attributes:
        method: in words.
        links: the links as the formulas read them.
        build: makes the function solve(rows, free) of the module of the formulas.
        keeps_tool_point: whether rows hold the place of the tool point, not of the last frame.
    """

    method: str
    links: DHLinks
    build: Callable[[DHLinks, Operations], Solve]
    keeps_tool_point: bool = False

    @property
    def T_after(self) -> FloatArray:
        """The rows of a pose `T` = T_S_tool are those of T_1_S T T_after."""
        T = self.links.T_tool_n
        return se3.from_rotation_translation(T[:3, :3], np.zeros(3)) if self.keeps_tool_point else T


def form_of(links: DHLinks) -> Form | str:
    """Return the closed form of four or six axes, or the condition that these links miss."""
    if links.n == 4:
        missing = why_not_parallel(links)
        return missing or Form(
            "closed form for four axes: pan and three parallel axes",
            pointed(links),
            four_axes,
            keeps_tool_point=True,
        )
    if links.n != 6:
        return f"it has {links.n} axes"
    if is_parallel_shoulder(links):
        return Form(
            "closed form for six axes with a spherical wrist",
            links,
            parallel_shoulder,
        )
    if is_crossing_shoulder(links):
        return Form(
            "closed form for six axes with a spherical wrist and a shoulder whose axes meet",
            links,
            crossing_shoulder,
        )
    parallel = why_not_parallel(links)
    if not parallel:
        return Form(
            "closed form for six axes, three of them parallel",
            links,
            six_axes,
        )
    return f"{why_not_spherical(links)}, and {parallel}"


@dataclass(frozen=True, eq=False)
class ClosedForm(Kinematics):
    """Inverse kinematics of one chain in closed form: all branches of every pose.

    Attributes:
        chain: the chain.
        form: the closed form.
    """

    form: Form

    @staticmethod
    def of(chain: Chain, links: DHLinks) -> ClosedForm | str:
        """Return the closed form of `chain`, or the conditions that it misses."""
        form = form_of(links)
        return form if isinstance(form, str) else ClosedForm(chain, form)

    @property
    def method(self) -> str:
        """The method in words."""
        return self.form.method

    @property
    def is_exact(self) -> bool:
        """True for six axes."""
        return self.chain.n == 6

    def postures(self, T: FloatArray, near: FloatArray) -> FloatArray:
        """Return `solve` with the angles of ``near`` where the pose leaves them free."""
        return np.array(self.solve(T, near.tolist()))

    @cached_property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, in the order of the solutions; see branch_words.py."""
        words = BranchWords(self.chain, tuple(range(self.chain.n)))
        return words.in_order(lambda T, q: np.array(self.solve(T, q.tolist())))

    @cached_property
    def _solve_arrays(self) -> Solve:
        return self.form.build(self.form.links, ARRAYS)

    @cached_property
    def rounding(self) -> FileRounding:
        """The rounding of the file that describes the chain."""
        return FileRounding(self.chain, self.form.links)

    @property
    def file_offset(self) -> float:
        """`FileRounding.offset`."""
        return self.rounding.offset

    @cached_property
    def _canonical(self) -> Callable[[FloatArray, Sequence[float]], Iterable[Angles]]:
        """A function for the canonical angles of all branches, without the rounding of the file.

        It takes a pose (4, 4) and the canonical angles that are used where it leaves them free.
        """
        form = self.form
        solve = form.build(form.links, FLOATS)
        before, after = form.links.T_1_S, form.T_after

        def canonical(T: FloatArray, free: Sequence[float]) -> Iterable[Angles]:
            # For one pose `dot` takes half the time of `@`.
            return solve(before.dot(T).dot(after).tolist(), free)

        return canonical

    @cached_property
    def _joints(self) -> Callable[[Sequence[float]], Angles]:
        """A function for the joint angles [rad] of canonical angles."""
        shift = self.form.links.shift
        ends = zip(self.chain.lower.tolist(), self.chain.upper.tolist(), strict=True)
        limits = [(k, *end) for k, end in enumerate(ends) if another_turn_helps(*end)]
        remainder, tau = math.remainder, math.tau

        def joints(alpha: Sequence[float]) -> Angles:
            q = [remainder(angle - offset, tau) for angle, offset in zip(alpha, shift, strict=True)]
            for joint, lower, upper in limits:
                q[joint] = in_turn(q[joint], lower, upper)
            return tuple(q)

        return joints

    def solve(self, T: FloatArray, free: Sequence[float] | None = None) -> list[Angles]:
        """Return the joint angles of all branches for the pose `T` (4, 4), without checks.

        For loops over many poses. `free` (n,) [rad] are the angles that are taken where the pose
        leaves them free; None for zeros. Each angle is in the turn inside its limits if there is
        one, else in [-pi, pi].
        """
        alpha = shift = self.form.links.shift
        if free is not None:
            alpha = tuple(map(float.__add__, free, shift))
        canonical, joints = self._canonical, self._joints
        q = [joints(angles) for angles in canonical(T, alpha)]
        if not self.rounding.is_corrected:
            return q

        def again(targets: FloatArray) -> FloatArray:
            return np.array(
                [joints([*canonical(target, alpha)][k]) for k, target in enumerate(targets)]
            )

        poses = np.repeat(T[None], len(q), axis=0)
        solve_again = again if self.chain.n == 4 else None
        return list(map(tuple, self.rounding.corrected(np.array(q), poses, solve_again).tolist()))

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return a posture for each of `branches`; see `Kinematics.inverse`.

        Where no exact posture exists, the postures come as near as the subproblems can: the tool
        point, or the wrist's centre, nearest along the links. Their errors give the difference.
        Two branches coincide where they meet.
        """
        pose = se3.validated(T)
        if q_hint is None and not self.rounding.is_corrected:
            # A branch is computed when it is read.
            return self._solutions(
                pose, map(self._joints, self._canonical(pose, self.form.links.shift))
            )
        hint = None if q_hint is None else self.chain.check_q(q_hint)
        angles = self.solve(pose, None if hint is None else hint.tolist())
        if hint is not None:
            angles = list(map(tuple, nearest_turn(self.chain, np.array(angles), hint).tolist()))
        return self._solutions(pose, angles)

    def _solutions(self, T: FloatArray, angles: Iterable[Angles]) -> Solutions:
        slack = self.rounding.slack
        return Solutions(self.chain, T, angles, self.branches, lambda _T: (slack, slack))

    def inverse_batch(self, T: npt.ArrayLike) -> FloatArray:
        """Return the joint angles (N, branches, n) [rad] for poses `T` (N, 4, 4) [m].

        As `solve` for each. Raises InputError for the first invalid pose.
        """
        return self.solve_batch(validated_poses(T))

    def solve_batch(self, poses: FloatArray) -> FloatArray:
        """Return `inverse_batch` of poses (N, 4, 4), without checks."""
        q = self._exact_batch(poses)
        if self.rounding.is_corrected:
            for k in range(q.shape[1]):
                solve = partial(self._exact_on, k) if self.chain.n == 4 else None
                q[:, k] = self.rounding.corrected(q[:, k], poses, solve)
        return q

    def _exact_on(self, branch: int, poses: FloatArray) -> FloatArray:
        return self._exact_batch(poses)[:, branch]

    def _exact_batch(self, poses: FloatArray) -> FloatArray:
        shift = self.form.links.shift
        with np.errstate(all="ignore"):
            solutions = [
                *self._solve_arrays(
                    np.moveaxis(self.form.links.T_1_S @ poses @ self.form.T_after, 0, -1),
                    shift,
                )
            ]
        zeros = np.zeros(len(poses))
        alpha = np.array([[angle + zeros for angle in angles] for angles in solutions])
        q = in_limits_turns(self.chain, alpha.transpose(2, 0, 1) - shift)
        if self.form.build is six_axes:
            # Where axes 4 and 6 are in line, case distinctions keep axis 4 in reach.
            in_line = (np.abs(np.sin(alpha[:, 4])) < LOOSE).any(axis=0)
            for number in np.flatnonzero(in_line).tolist():
                q[number] = list(map(self._joints, self._canonical(poses[number], shift)))
        return q
