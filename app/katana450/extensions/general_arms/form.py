"""The closed forms, and the choice of one by the dimensions of an arm."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

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

    def columns(self, T: FloatArray) -> list[list[FloatArray]]:
        """Return the rows that the formulas read, for many poses `T` (N, 4, 4) = T_S_tool.

        An array (N,) is in place of a number.
        """
        here = self.links.T_1_S @ T
        if self.keeps_tool_point:
            here[:, :3, :3] = here[:, :3, :3] @ self.links.T_n_tool[:3, :3].T
        else:
            here = here @ self.links.T_tool_n
        return [[here[:, i, j] for j in range(4)] for i in range(4)]


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
