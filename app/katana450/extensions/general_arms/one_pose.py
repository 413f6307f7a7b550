"""The closed form of one arm for one pose at a time, with the dimensions of the arm folded in."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from katana450 import tolerances
from katana450.extensions.general_arms.form import Form
from katana450.extensions.general_arms.functions import Number
from katana450.extensions.general_arms.straight_line import Code, TermList
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain

Matrix = Sequence[Sequence[Number]]

INPUTS = (("r11", "r12", "r13", "x"), ("r21", "r22", "r23", "y"), ("r31", "r32", "r33", "z"))
"""Names of the numbers of a pose."""

LAST = ("o1", "o2", "o3", "one")
"""Names of the numbers in its last row."""


def one_pose(chain: Chain, form: Form, *, is_reversed: bool, checks: bool = False) -> Code:
    """Return solve(pose, free): the joint angles [rad] of all branches.

    ``pose`` are the 16 numbers of T_S_tool, row by row, and ``free`` (n,) the canonical angles
    [rad] that are taken where the pose leaves them free; zero joint angles by default. Each angle
    is in the turn inside its limits if there is one, else in [-pi, pi]. If it ``checks``, the
    function returns None for numbers that are no pose to within double precision.
    """
    terms = TermList()
    rows: Matrix = [[terms.term(name) for name in names] for names in INPUTS]
    if checks:
        terms.require(*_is_clean(terms, rows))
    if is_reversed:
        rows = _inverse(rows)
    free = [terms.term(f"free[{k}]") for k in range(chain.n)]
    found = form.build(form.links, terms.operations())([*_inner(form, rows), ()], free)
    order = range(chain.n - 1, -1, -1) if is_reversed else range(chain.n)
    joints = list(zip(order, chain.lower.tolist(), chain.upper.tolist(), strict=True))
    shift = form.links.shift
    outputs = [
        [terms.turned(alpha[k] - shift[k], lower, upper) for k, lower, upper in joints]
        for alpha in found
    ]
    inputs = ", ".join(itertools.chain(*INPUTS, LAST))
    return terms.compiled(f"{inputs} = pose", outputs, shift)


def _is_clean(terms: TermList, rows: Matrix) -> list[Number]:
    """Return conditions under which `se3.validated_rows` corrects nothing.

    Few poses are refused that it accepts: those that are farther away than any arm reaches.
    """
    hypot = terms.operations().hypot
    (a, b, c, x), (d, e, f, y), (g, h, i, z) = rows
    misfit = hypot(
        a * a + d * d + g * g - 1.0,
        b * b + e * e + h * h - 1.0,
        a * b + d * e + g * h,
        d * h - g * e - c,
        g * b - a * h - f,
        a * e - d * b - i,
    )
    last = terms.term("(not ({0} or {1} or {2}) and {3} == 1.0)", *map(terms.term, LAST))
    return [misfit <= se3.MISFITS_EXACT, x * x + y * y + z * z <= tolerances.FARTHEST, last]


def _inner(form: Form, rows: Matrix) -> Matrix:
    """Return the rows (3, 4) that the formulas read, as `Form.columns`."""
    before, after = _exact(form.links.T_1_S), _exact(form.links.T_tool_n)
    here = _product(before, rows)
    turned = _product(here, after)
    if not form.keeps_tool_point:
        return turned
    return [[*row[:3], place[3]] for row, place in zip(turned, here, strict=True)]


def _exact(T: FloatArray) -> list[list[float]]:
    """Return the rows (3, 4) of `T` with 0 and 1 in place of numbers that differ by rounding."""
    return [
        [float(round(x)) if abs(x - round(x)) <= tolerances.ROUNDING else x for x in row]
        for row in T[:3].tolist()
    ]


def _product(A: Matrix, B: Matrix) -> Matrix:
    """Return the product (3, 4) of two rigid motions (3, 4)."""
    result = []
    for a in A:
        row = [a[0] * B[0][j] + a[1] * B[1][j] + a[2] * B[2][j] for j in range(4)]
        result.append([*row[:3], row[3] + a[3]])
    return result


def _inverse(T: Matrix) -> Matrix:
    return [
        [T[0][i], T[1][i], T[2][i], -(T[0][i] * T[0][3] + T[1][i] * T[1][3] + T[2][i] * T[2][3])]
        for i in range(3)
    ]
