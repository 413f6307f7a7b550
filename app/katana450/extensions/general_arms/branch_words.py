"""The names of branches in words for what a person sees, measured at the axes of a posture.

A branch of six axes is a side of three singularities. At each of them a product of axes z and
points P on them is zero, and its sign gives one word:

    shoulder   (z1 x z2) . (W - P1)         W: the wrist's centre; with four axes, the tool point
    elbow      z3 . ((P3 - P2) x (W - P3))  W: axis 4 if it is parallel to axis 3
    wrist      z4 . (z5 x z6)

If axis 4 or 6 moves the wrist's centre, the wrist's product is that of the rates of axes 4 to 6
while the first three hold the centre. It is zero where the arm is singular.

An arm that is solved as seen from the tool has the first and the last with the ends exchanged. The
joint that sets the arm angle of seven axes is left out. Which sign has which word follows from the
arm at zero and from up (z) and front (x) of the base, not from the directions that a file gives its
axes:

    left, right   if the arm's plane passes beside axis 1: the arm is left or right of axis 1, seen
                  from there towards the wrist. Then "front" below is the direction of the wrist.
    front, back   else: the wrist is in front of axis 1 or behind it. Front is the side on which
                  axis 2 passes axis 1, or x of the base with axis 1 at zero. If three axes meet in
                  the shoulder, the upper arm leans to the front or to the back.
    up, down      seen with the front on the right, the forearm bends down from the upper arm or up.
                  So while the arm reaches to the front, the elbow is above or below the line from
                  shoulder to wrist.
    noflip, flip  the same of hand and forearm, with the forearm not rolled. Three parallel axes: if
                  the tool points down, axis 5 leads from axis 4 to the front or to the back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from katana450.caching import cached_property
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space

ZERO: Final = 1e-6
"""[1] or [m] Sine or distance that counts as zero."""

SHOULDERS: Final = ("front", "back", "left", "right")
ELBOWS: Final = ("up", "down")
WRISTS: Final = ("noflip", "flip")
BRANCH_NAMES: Final = tuple(
    "-".join(words)
    for parts in ((SHOULDERS, ELBOWS), (SHOULDERS, ELBOWS, WRISTS))
    for words in product(*parts)
)
"""The words, and all names, of arms with four or five axes and with more."""

SECOND: Final = ("right", "back", "down", "flip")
"""The second word of each pair."""

ORDINALS: Final = ("second", "third", "fourth")
"""Last words of further postures of a pose on the same branch, of an arm with an offset wrist."""

SAMPLES: Final = 200
"""Maximum number of postures at which the order of the names is looked for."""


@dataclass(frozen=True, eq=False)
class _Look:
    """The axes that decide the branch, in one posture.

    Attributes:
        z: (k, 3) their directions.
        p: (k, 3) a point on each of them [m].
        tool: (3,) the tool point [m].
    """

    z: FloatArray
    p: FloatArray
    tool: FloatArray

    def are_parallel(self, i: int, j: int) -> bool:
        """Return whether two axes are parallel or opposite."""
        return bool(np.linalg.norm(np.cross(self.z[i], self.z[j])) < ZERO)

    def foot(self, i: int, j: int) -> FloatArray:
        """Return the point (3,) of axis i that is nearest to axis j; any if they are parallel."""
        start: FloatArray = self.p[i]
        if self.are_parallel(i, j):
            return start
        normal = np.cross(self.z[i], self.z[j])
        along = float(np.cross(self.p[j] - start, self.z[j]) @ normal / (normal @ normal))
        point: FloatArray = start + along * self.z[i]
        return point

    def ahead(self, i: int, j: int, point: FloatArray) -> float:
        """Return the distance of ``point`` (3,) from the plane through axis i along axis j."""
        return float(np.cross(self.z[i], self.z[j]) @ (point - self.p[i]))

    def bend(self, i: int, start: FloatArray, end: FloatArray) -> float:
        """Return the turn about axis i of the line to ``end`` against that from ``start``."""
        return float(self.z[i] @ np.cross(self.p[i] - start, end - self.p[i]))

    def twist(self, i: int) -> float:
        """Return the triple product of the axes i, i + 1 and i + 2."""
        return float(self.z[i] @ np.cross(self.z[i + 1], self.z[i + 2]))

    def held_twist(self, point: FloatArray) -> float:
        """Return `twist` of the last three axes while the first three hold ``point`` (3,)."""
        moves = np.cross(self.z, point - self.p)
        J = np.concatenate((moves, self.z), axis=1)
        return float(np.linalg.det(J) / np.linalg.det(moves[:3]))


@dataclass(frozen=True, eq=False)
class BranchWords:
    """The words for the postures of one arm; the module's text defines them.

    Attributes:
        chain: the arm.
        joints: indices of its four or six joints that decide the branch, from the base.
        is_reversed: whether it is solved as seen from the tool.
        offset: index of the joint that moves the wrist's centre, 3 or 5; None if the last three
            axes meet there, or axes 2 to 4 are parallel.
    """

    chain: Chain
    joints: tuple[int, ...]
    is_reversed: bool = False
    offset: int | None = None

    def of(self, q: FloatArray) -> str:
        """Return the name of the branch of the joint angles `q` (n,) [rad]."""
        tool = forward(self.chain, q)[:3, 3]
        look = self._look(jacobian_space(self.chain, q), tool)
        return "-".join(self._from_tool(look) if self.is_reversed else self._from_base(look))

    def in_order(self, solve: Callable[[FloatArray, FloatArray], FloatArray]) -> tuple[str, ...]:
        """Return the names in the order in which ``solve`` returns the branches.

        `solve` takes a pose (4, 4), and the joint angles (n,) [rad] that give it. It returns one
        posture (k, n) a branch. Raises RobotDescriptionError if the words do not distinguish the
        branches, which the conditions of the closed forms exclude.
        """
        rng = np.random.default_rng(450)
        for _ in range(SAMPLES):
            q = rng.uniform(-np.pi, np.pi, self.chain.n)
            names = tuple(map(self.of, solve(forward(self.chain, q), q)))
            if len(set(names)) == len(names):
                return names
        raise RobotDescriptionError("The postures of this arm on its branches look the same.")

    def _look(self, S: FloatArray, tool: FloatArray) -> _Look:
        axes = S[:, list(self.joints)].T
        return _Look(axes[:, :3], np.cross(axes[:, :3], axes[:, 3:]), tool)

    @cached_property
    def _zero(self) -> _Look:
        return self._look(self.chain.S, self.chain.M[:3, 3])

    @cached_property
    def _front(self) -> float:
        """1 if z1 x z2 points to the front with axis 1 at zero, else -1."""
        zero = self._zero
        x, y, _ = np.cross(zero.z[0], zero.z[1]).tolist()
        sides = (zero.ahead(0, 1, zero.p[1]), x, y)
        return next((_sign(side) for side in sides if abs(side) > ZERO), 1.0)

    @cached_property
    def _up(self) -> float:
        """1 if axis 1 points up, else -1."""
        return _sign(float(self._zero.z[0, 2]))

    def _is_parallel(self, i: int) -> bool:
        """Return whether axis i and the next one are parallel, none locked between them."""
        return self.joints[i + 1] == self.joints[i] + 1 and self._zero.are_parallel(i, i + 1)

    def _along_axis_2(self, i: int) -> float:
        return float(self._zero.z[i] @ self._zero.z[1])

    def _outward(self, look: _Look, i: int, start: FloatArray, end: FloatArray) -> float:
        """Return 1 if axis i points from ``start`` to ``end`` (3,), else -1.

        If the places are the same, the direction counts that is up or to the front at zero.
        """
        along = float(look.z[i] @ (end - start))
        return _sign(along if abs(along) > ZERO else max(self._zero.z[i].tolist(), key=abs))

    def _from_foot(self, look: _Look, i: int, j: int, end: FloatArray) -> float:
        """Return `_outward` from the foot of axis i on axis j."""
        return self._outward(look, i, end if look.are_parallel(i, j) else look.foot(i, j), end)

    def _lowers(self, i: int) -> float:
        """Return 1 if a positive turn of axis i at zero lowers what points to the front, or -1."""
        return -self._up * self._front * _sign(self._along_axis_2(i))

    def _from_base(self, look: _Look) -> tuple[str, ...]:
        has_wrist = len(self.joints) > 4
        wrist = look.tool
        if has_wrist:
            wrist = look.foot(3, 4) if self.offset == 5 else look.foot(4, 5)
        faces = self._front * look.ahead(0, 1, wrist)
        aside = self._up * self._front * self._beside(look, wrist)
        if aside:
            shoulder, side = "left" if aside * faces < 0.0 else "right", _sign(faces)
        else:
            shoulder, side = "front" if faces >= 0.0 else "back", 1.0
        end = look.p[3] if self._is_parallel(2) else wrist
        elbow = _elbow(side * self._lowers(2) * look.bend(2, look.foot(1, 0), end))
        if not has_wrist:
            return shoulder, elbow
        if abs(self._along_axis_2(4)) >= abs(self._along_axis_2(3)):
            side *= -self._lowers(4) * self._from_foot(look, 3, 2, wrist)
        else:
            side *= self._lowers(3) * self._from_foot(look, 4, 3, wrist)
        hand = self._outward(look, 5, wrist, look.tool)
        twist = look.twist(3) if self.offset is None else look.held_twist(wrist)
        return shoulder, elbow, _wrist(side * hand * twist)

    def _beside(self, look: _Look, wrist: FloatArray) -> float:
        """Return the distance along axis 2 of the arm's plane from axis 1 [m].

        It is 0 if it is not constant, or less than that by which axis 2 passes axis 1.
        """
        offset = abs(look.ahead(0, 1, look.p[1]))
        aside = float(look.z[1] @ (wrist - look.p[0]))
        upright = abs(float(look.z[0] @ look.z[1])) < ZERO and self._is_parallel(1)
        upright &= self.offset != 3
        return aside if upright and abs(aside) > max(offset, ZERO) else 0.0

    def _from_tool(self, look: _Look) -> tuple[str, ...]:
        centre = look.foot(1, 0)
        wrist = look.p[4] if self._is_parallel(3) else look.foot(4, 5)
        leans = self._front * self._from_foot(look, 2, 3, centre) * look.twist(0)
        start = look.p[2] if self._is_parallel(2) else centre
        elbow = _elbow(self._lowers(3) * look.bend(3, start, wrist))
        if abs(self._along_axis_2(5)) >= abs(self._along_axis_2(4)):
            side = self._lowers(5) * self._from_foot(look, 4, 3, wrist)
        else:
            side = self._lowers(4) * self._outward(look, 5, look.foot(5, 4), look.tool)
        away = look.ahead(5, 4, centre)
        return "front" if leans <= 0.0 else "back", elbow, _wrist(side * away)


def _sign(x: float) -> float:
    """Return 1, or -1 if `x` is clearly negative."""
    return -1.0 if x < -ZERO else 1.0


def _elbow(bends_down: float) -> str:
    return "up" if bends_down >= 0.0 else "down"


def _wrist(bends_down: float) -> str:
    return "noflip" if bends_down >= 0.0 else "flip"


def in_order_for_people(branches: tuple[AnyBranch, ...]) -> tuple[str, ...]:
    """Return the names of branches with those of usual postures first, without ordinals."""
    second = {
        name: [word in SECOND for word in name.split("-")]
        for name in map(str, branches)
        if not name.endswith(ORDINALS)
    }
    return tuple(sorted(second, key=second.__getitem__))
