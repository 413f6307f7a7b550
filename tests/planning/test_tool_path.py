"""Tool paths: the tool is exactly on the curve everywhere, or the path is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.arm import ArmModel
from katana450.errors import InputError
from katana450.extensions.programs.planning.curve_path import ToolPath
from katana450.extensions.programs.planning.curves import (
    Linear,
    Swing,
    ToolArc,
    ToolLine,
    ToolLines,
    roomiest,
)
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import Path, joint_derivatives, point_derivatives
from tests.conftest import LONG
from tests.kinematics.family import random_member

FRONT_UP = Branch("front", "up")


def q_at(path: Path, sigma: float) -> FloatArray:
    return np.array([joint.c0 for joint in path.joints(Jet.variable(sigma))])


def test_circle_of_the_paper_is_exact(arm: ArmModel, paths: dict[str, Path]) -> None:
    path, chain = paths["circle"], arm.chain_to("flange")
    for place in np.linspace(0.0, 1.0, 2001 if LONG else 501).tolist():
        angle = math.tau * place
        x, y, z = forward(chain, q_at(path, place))[:3, 3]
        wanted = 0.15, -0.1 * math.sin(angle), -0.11 + 0.1 * math.cos(angle)
        assert math.dist((x, y, z), wanted) < 1e-15
        assert abs(math.hypot(y, z + 0.11) - 0.1) < 1e-15


def test_circle_keeps_its_pitch_and_closes(arm: ArmModel, paths: dict[str, Path]) -> None:
    path, chain = paths["circle"], arm.chain_to("flange")
    for sigma in np.linspace(0.0, 1.0, 50).tolist():
        target = ToolTarget.at(chain, q_at(path, sigma))
        assert target.pitch == pytest.approx(math.radians(99.0), abs=1e-15)
        assert target.roll == 0.0
    assert path.end == pytest.approx(path.start, abs=1e-14)


@pytest.mark.parametrize("tool", ["flange", "grasp", "tcp"])
def test_a_pitch_that_follows_the_circle_leaves_more_room(
    arm: ArmModel, circle: ToolArc, tool: str
) -> None:
    """At a constant pitch only the flange gets round, with a margin of 11.9 deg."""
    chain = arm.chain_to(tool)
    arc = roomiest(chain, FRONT_UP, circle)
    q = joint_derivatives(ToolPath(chain, arc, FRONT_UP, np.zeros(5)), np.linspace(0, 1, 500))[0]
    room = np.minimum(q - chain.lower, chain.upper - q).min()
    assert room > math.radians({"flange": 28.7, "grasp": 11.5, "tcp": 3.5}[tool])
    if tool != "flange":
        with pytest.raises(InputError, match="along it"):
            ToolPath(chain, circle, FRONT_UP, np.zeros(5))


def test_arc_without_a_feasible_pitch_is_refused(arm: ArmModel, circle: ToolArc) -> None:
    with pytest.raises(InputError, match="No pitch"):
        roomiest(arm.chain, FRONT_UP, replace(circle, start=np.array([0.15, 0.0, 0.9])))


@settings(max_examples=25 if LONG else 8)
@given(st.integers(0, 2**32 - 1))
def test_lines_of_any_member_are_straight_and_keep_their_branch(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain, offsets = random_member(rng)
    q = rng.uniform(-2.5, 2.5, 5)
    start, branch = ToolTarget.at(chain, q), branch_of(chain, q)
    step = 0.1 * offsets.size * rng.normal(size=3)
    end = ToolTarget(start.position + step, start.pitch + 0.2, start.roll - 0.3)
    try:
        path = ToolPath(chain, ToolLine(start, end), branch, q)
    except InputError:
        return
    assert path.start == pytest.approx(q, abs=1e-7)
    for sigma in rng.uniform(size=4).tolist():
        posture = q_at(path, sigma)
        wanted, actual = start.towards(end, sigma), ToolTarget.at(chain, posture)
        assert actual.position == pytest.approx(wanted.position, abs=1e-12)
        assert math.remainder(actual.pitch - wanted.pitch, math.tau) == pytest.approx(
            0.0, abs=1e-12
        )
        assert math.remainder(actual.roll - wanted.roll, math.tau) == pytest.approx(0.0, abs=1e-12)
        assert branch_of(chain, posture) == branch
        assert chain.within_limits(posture)


@pytest.mark.parametrize("name", ["circle", "line", "pour", "lines", "joints", "via"])
def test_derivatives_agree_with_differences(paths: dict[str, Path], name: str) -> None:
    path = paths[name]
    joins = (0.0, *path.joins, 1.0)
    for low, high in pairwise(joins):
        h = min(1e-4, 1e-3 * (high - low))
        places = np.linspace(low + 2 * h, high - 2 * h, 9)
        for derivatives in (joint_derivatives, point_derivatives):
            before, middle, after = (derivatives(path, places + step) for step in (-h, 0.0, h))
            for order in range(3):
                measured = (after[order] - before[order]) / (2.0 * h)
                scale = np.abs(middle[order + 1]).max() + 1.0
                assert measured == pytest.approx(middle[order + 1], abs=3e-5 * scale)


@pytest.mark.parametrize("name", ["circle", "line", "pour", "lines", "joints", "via"])
def test_one_place_and_many_agree(paths: dict[str, Path], name: str) -> None:
    places = np.linspace(0.0, 1.0, 23)
    many = joint_derivatives(paths[name], places)[0]
    for sigma, q in zip(places.tolist(), many, strict=True):
        assert q_at(paths[name], sigma) == pytest.approx(q, abs=1e-14)


def test_lines_are_straight_between_their_corners_and_pass_them_near(
    arm: ArmModel, paths: dict[str, Path]
) -> None:
    path, chain = paths["lines"], arm.chain
    assert isinstance(path, ToolPath)
    curve = path.curve
    assert isinstance(curve, ToolLines)
    points = np.array([via.position for via in curve.vias])
    legs, on = list(pairwise(points)), 0
    for sigma in np.linspace(0.0, 1.0, 301).tolist():
        T = forward(chain, q_at(path, sigma))
        desired = np.array([value.c0 for value in curve.at(Jet.variable(sigma))[:5]])
        assert T[:3, 3] == pytest.approx(desired[:3], abs=1e-14)
        target = ToolTarget.at(chain, q_at(path, sigma))
        assert (target.pitch, target.roll) == pytest.approx(tuple(desired[3:]), abs=1e-13)
        away = min(off_leg(T[:3, 3], *leg) for leg in legs)
        # The largest distance from its legs that half of the shorter one with such a blend allows.
        assert away < 0.8 * 0.5 * 0.12
        on += away < 1e-12
    assert on > 100
    for via, near in zip(points[1:3], (0.03, 0.01), strict=True):
        tool = curve.at(Jet.variable(np.linspace(0.0, 1.0, 4001)))
        traced = np.column_stack(np.broadcast_arrays(*(value.c0 for value in tool[:3])))
        passed = float(np.linalg.norm(traced - via, axis=1).min())
        assert 1e-5 < passed < near
    start = ToolTarget.at(chain, path.start)
    assert start.position == pytest.approx(points[0], abs=1e-14)
    assert forward(chain, path.end)[:3, 3] == pytest.approx(points[-1], abs=1e-14)


def off_leg(p: FloatArray, a: FloatArray, b: FloatArray) -> float:
    """Return the distance [m] of `p` from the segment from `a` to `b`."""
    leg = b - a
    fraction = np.clip((p - a) @ leg / max(float(leg @ leg), 1e-30), 0.0, 1.0)
    return math.dist(p, a + fraction * leg)


def test_invalid_lines_are_refused(arm: ArmModel, ready: FloatArray) -> None:
    start = ToolTarget.at(arm.chain, ready)
    goal = ToolTarget(start.position + np.array([0.0, 0.05, 0.0]), start.pitch, start.roll)
    beyond = ToolTarget(start.position + np.array([0.6, 0.0, 0.0]), start.pitch, start.roll)
    none, half = np.empty(0), np.array([0.5])
    for vias, blend in (
        ((start,), none),
        ((start, start), none),
        ((start, goal, goal), half),
        ((start, goal, start), none),
        ((start, goal, start), np.array([0.0])),
        ((start, goal, start), np.array([1.1])),
        ((start, goal, start), np.array([math.nan])),
        ((start, ToolTarget(start.position, math.nan, 0.0)), none),
    ):
        with pytest.raises(InputError):
            ToolLines(vias, blend)
    with pytest.raises(InputError, match="leaves the reach of the arm"):
        ToolPath(arm.chain, ToolLines((start, goal, beyond), half), FRONT_UP, ready)


@pytest.mark.parametrize("blend", [0.01, 0.1, 1.0])
def test_small_corner_is_smooth(arm: ArmModel, ready: FloatArray, blend: float) -> None:
    start = ToolTarget.at(arm.chain, ready)
    steps = ((0.0, 0.0, 0.0), (0.0, 0.08, 0.0), (0.0, 0.0, -0.06), (0.0, -0.05, 0.0))
    vias = tuple(ToolTarget(start.position + step, start.pitch, start.roll) for step in steps)
    path = ToolPath(arm.chain, ToolLines(vias, np.full(2, blend)), FRONT_UP, ready)
    assert path.start == pytest.approx(ready, abs=1e-12)


def straight(chain: Chain, q: FloatArray, step: tuple[float, float, float]) -> ToolPath:
    start = ToolTarget.at(chain, q)
    line = ToolLine(start, ToolTarget(start.position + step, start.pitch, start.roll))
    return ToolPath(chain, line, branch_of(chain, q), q)


def test_a_line_out_of_reach_is_refused_where_it_leaves(arm: ArmModel, ready: FloatArray) -> None:
    with pytest.raises(
        InputError, match=r"leaves the reach of the arm.* (\d+\.\d) % along"
    ) as raised:
        straight(arm.chain, ready, (0.6, 0.0, 0.0))
    fraction = float(str(raised.value).split(" % along")[0].split()[-1]) / 100.0
    straight(arm.chain, ready, (0.6 * (fraction - 0.01), 0.0, 0.0))
    with pytest.raises(InputError, match="reach"):
        straight(arm.chain, ready, (0.6 * (fraction + 0.01), 0.0, 0.0))


def test_a_line_over_a_limit_names_it(arm: ArmModel, ready: FloatArray) -> None:
    start = ToolTarget.at(arm.chain, ready)
    line = ToolLine(start, ToolTarget(start.position, start.pitch, 4.0))
    with pytest.raises(
        InputError, match=r"axis 5, wrist roll, over its limit of 171.5 deg 74\.8 % along"
    ):
        ToolPath(arm.chain, line, FRONT_UP, ready)


def test_a_limit_touched_between_two_places_is_found(arm: ArmModel, circle: ToolArc) -> None:
    """The limit is just below the peak of axis 2 between two checked places."""
    chain = arm.chain_to("flange")
    dense = np.linspace(0.0, 1.0, 50001)
    q = joint_derivatives(ToolPath(chain, circle, FRONT_UP, np.zeros(5)), dense)[0]
    for axis in (1, 3):
        for gap, refused in ((1e-8, True), (-1e-8, False)):
            upper = np.array(chain.upper)
            upper[axis] = q[:, axis].max() - gap
            other = replace(chain, upper=upper)
            if refused:
                with pytest.raises(InputError, match=f"axis {axis + 1}, .* over its limit"):
                    ToolPath(other, circle, FRONT_UP, np.zeros(5))
            else:
                ToolPath(other, circle, FRONT_UP, np.zeros(5))


def test_a_line_through_axis_1_is_refused(arm: ArmModel) -> None:
    q = np.radians((0.0, -110.0, 100.0, 60.0, 0.0))
    x = float(forward(arm.chain, q)[0, 3])
    with pytest.raises(InputError, match="along it"):
        straight(arm.chain, q, (-2.0 * x, 0.0, 0.0))


@pytest.mark.parametrize("beyond", [1e-7, -1e-12])
def test_a_curve_that_only_grazes_the_reach_is_refused(arm: ArmModel, beyond: float) -> None:
    """The arm is stretched, or would have to be longer, between two checked places."""
    chain, canonical = arm.chain, arm_of(arm.chain)
    radius = canonical.l1 + canonical.l2 + canonical.l3 - 0.1 + beyond
    level, centre = Linear(0.0, 0.0), np.array([0.1, 0.0, 0.0])
    start = centre + radius * np.array([math.cos(0.7), -math.sin(0.7), 0.0])
    arc = ToolArc(start, centre, np.array([0.0, 0.0, 1.0]), 1.4031, level, level)
    with pytest.raises(InputError, match=r"\(631.8, .*Links come in line"):
        ToolPath(chain, arc, FRONT_UP, np.zeros(5))
    nearer = replace(arc, start=centre + (1.0 - 2e-3) * (start - centre))
    ToolPath(chain, nearer, FRONT_UP, np.zeros(5))


def test_a_tool_beside_the_roll_axis_follows_lines_exactly() -> None:
    rng, followed = np.random.default_rng(3), 0
    for _ in range(20):
        chain, _ = random_member(rng, lateral=True)
        M = chain.M @ se3.from_rotation_translation(np.eye(3), rng.normal(size=3) * 0.02)
        chain = chain.with_tool(M)
        q = rng.uniform(-2.0, 2.0, 5)
        start = ToolTarget.at(chain, q)
        end = ToolTarget(start.position + 0.02 * rng.normal(size=3), start.pitch, start.roll + 0.2)
        for branch in BRANCHES:
            try:
                path = ToolPath(chain, ToolLine(start, end), branch, q)
            except InputError:
                continue
            followed += 1
            for sigma in (0.0, 0.6):
                position = ToolTarget.at(chain, q_at(path, sigma)).position
                assert position == pytest.approx(start.towards(end, sigma).position, abs=1e-12)
    assert followed > 20


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_invalid_numbers_are_refused(arm: ArmModel, ready: FloatArray, bad: float) -> None:
    start = ToolTarget.at(arm.chain, ready)
    still = Linear(0.0, 0.0)
    for wrong in (
        lambda: ToolLine(start, ToolTarget(start.position, bad, 0.0)),
        lambda: ToolArc(start.position, np.zeros(3), np.array([0.0, bad, 0.0]), 1.0, still, still),
        lambda: ToolArc(start.position, np.zeros(3), np.ones(3), bad, still, still),
        lambda: ToolArc(start.position, np.zeros(3), np.zeros(3), 1.0, still, still),
        lambda: Linear(bad, 0.0),
        lambda: Swing(0.0, bad, 0.0, 0.0, 1.0),
        lambda: ToolPath(arm.chain, ToolLine(start, start), FRONT_UP, np.full(5, bad)),
    ):
        with pytest.raises(InputError):
            wrong()
