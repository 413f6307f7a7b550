"""The closed form of one arm for one pose at a time, with the dimensions of the arm folded in."""

from __future__ import annotations

from collections.abc import Sequence

from katana450 import tolerances
from katana450.extensions.general_arms.form import Form
from katana450.extensions.general_arms.functions import Number
from katana450.extensions.general_arms.straight_line import Code, TermList
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain

Matrix = Sequence[Sequence[Number]]

INPUTS = (("r11", "r12", "r13", "x"), ("r21", "r22", "r23", "y"), ("r31", "r32", "r33", "z"))
"""Names of the numbers of a pose."""


def one_pose(chain: Chain, form: Form, *, is_reversed: bool, thorough: bool) -> Code:
    """Return solve(rows, free): the joint angles [rad] of all branches.

    ``rows`` is T_S_tool (4, 4) as nested lists, and ``free`` (n,) the canonical angles [rad] that
    are taken where the pose leaves them free. Each angle is in the turn inside its limits if there
    is one, else in [-pi, pi]. Unless it is ``thorough``, the function returns None where the
    formulas distinguish rare cases.
    """
    terms = TermList(thorough=thorough)
    rows: Matrix = [[terms.term(name) for name in names] for names in INPUTS]
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
    inputs = ", ".join(f"({', '.join(names)})" for names in INPUTS)
    return terms.compiled(f"{inputs}, _ = rows", outputs)


def _inner(form: Form, rows: Matrix) -> Matrix:
    """Return the rows (3, 4) that the formulas read, as `Form.rows`."""
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
