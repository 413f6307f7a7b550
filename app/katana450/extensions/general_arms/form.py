"""The closed forms, and the choice of one by the dimensions of an arm."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from katana450.extensions.general_arms.functions import Operations
from katana450.extensions.general_arms.links import DHLinks
from katana450.extensions.general_arms.parallel_axes import (
    four_axes,
    pointed,
    six_axes,
    why_not_parallel,
)
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
