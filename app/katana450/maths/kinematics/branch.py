"""The four postures of the arm at one pose, bounded by its singularities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward

Shoulder = Literal["front", "back"]
Elbow = Literal["up", "down"]


@dataclass(frozen=True, order=True)
class Branch:
    """A region of the joint space that the arm leaves only through a singularity.

    The definitions hold for the canonical arm (see maths/kinematics/arm.py; the Katana is its own).
    The regions meet where r = 0 or sin(alpha3) = 0.

    Attributes:
        shoulder: "front" when the tool point's radial coordinate in the arm's plane, r = x
            cos(alpha1) + y sin(alpha1) from axis 1, is >= 0.
        elbow: "up" when sin(alpha3) >= 0, which puts the elbow above the line from shoulder to
            wrist while the arm faces front.
    """

    shoulder: Shoulder
    elbow: Elbow

    def __str__(self) -> str:
        return f"{self.shoulder}-{self.elbow}"

    @staticmethod
    def parse(text: str) -> Branch:
        """Return the branch named `text`, as `str` formats it; raise InputError on other text."""
        for branch in BRANCHES:
            if text == str(branch):
                return branch
        names = ", ".join(str(branch) for branch in BRANCHES)
        raise InputError(f"There is no branch {text!r}; the branches are {names}.")


AnyBranch = Branch | str
"""A branch of an arm: one of BRANCHES, or its name for an arm outside the five-axis family."""

BRANCHES: Final[tuple[Branch, ...]] = (
    Branch("front", "up"),
    Branch("front", "down"),
    Branch("back", "up"),
    Branch("back", "down"),
)


def branch_of(chain: Chain, q: npt.ArrayLike) -> Branch:
    """Return the branch of the joint angles `q` (5,) [rad]."""
    arm = arm_of(chain)
    q = chain.check_q(q)
    alpha1, _, alpha3, _, _ = arm.canonical(q).tolist()
    x, y = arm.pose(forward(chain, q))[:2, 3].tolist()
    r = x * math.cos(alpha1) + y * math.sin(alpha1)
    elbow_up = math.remainder(alpha3, math.tau) >= 0.0
    return Branch("front" if r >= 0.0 else "back", "up" if elbow_up else "down")
