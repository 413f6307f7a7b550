"""Test the messages about places out of reach and contacts: amount, cause, and what to copy."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.state.messages import AXIS_NAMES
from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.language.scope import ScriptFrame
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.planning.out_of_reach import unreached
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.tool import ToolTarget
from tests.programs.conftest import Stage

AMOUNT = re.compile(r"it is (\S+) mm out of reach, because (.*?)\.(?: It|$)")
LIMIT = re.compile(r"axis (\d), ([a-z ]+), is at its limit of (\S+) deg")
PLACE = "frame: {frame}\nsteps:\n  - move: {{x: {x}, y: {y}, z: {z}, pitch: {pitch}, roll: 0}}\n"
POINT = re.compile(r"`\{x: (\S+), y: (\S+), z: (\S+)\}`")
START = "  - move: {x: 400, y: 0, z: 300, pitch: 30, roll: 0}\n"


@pytest.fixture
def begin(stage: Stage) -> PlanState:
    T = stage.plan_context.T_base_shoulder
    return PlanState(stage.plan_context, stage.begin(), ScriptFrame.of(T, in_base=True))


def said(begin: PlanState, target: ToolTarget) -> str:
    """Return the message about ``target``."""
    assert begin.frame is not None
    return unreached(begin.planning, begin.q, target, None, begin.frame)


def nearest_by_search(chain: Chain, target: ToolTarget) -> float:
    """Return the distance [m] to the nearest point with the pitch of ``target``, on a fine grid.

    The arm faces the target. Axes 2 and 3 are searched on ever finer grids, and axis 4 gives the
    pitch, which is the sum of the three.
    """
    facing = math.atan2(target.position[1], target.position[0])
    low, high, best = chain.lower[1:3].copy(), chain.upper[1:3].copy(), math.inf
    for _ in range(7):
        a, b = np.meshgrid(*(np.linspace(low[i], high[i], 81) for i in range(2)))
        c = target.pitch - a - b
        q = np.stack([np.full_like(a, facing), a, b, c, np.zeros_like(a)], axis=-1).reshape(-1, 5)
        q = q[(chain.lower[3] <= q[:, 3]) & (q[:, 3] <= chain.upper[3])]
        p = forward_batch(chain, q)[:, :3, 3]
        apart = np.linalg.norm(p - target.position, axis=1)
        best, middle = min(best, float(apart.min())), q[apart.argmin(), 1:3]
        width = (high - low) / 16.0
        low = np.maximum(middle - width, chain.lower[1:3])
        high = np.minimum(middle + width, chain.upper[1:3])
    return best


def targets(count: int) -> list[ToolTarget]:
    """Return places in front of the arm, many of them out of reach."""
    rng = np.random.default_rng(31)
    rows = rng.uniform((0.35, -0.3, -0.1, -0.3), (0.75, 0.3, 0.5, 1.4), (count, 4)).tolist()
    return [ToolTarget(np.array(row[:3]), row[3], 0.0) for row in rows]


def test_amount_is_the_distance_to_the_nearest_point(begin: PlanState) -> None:
    stretched = limited = 0
    for target in targets(24):
        match = AMOUNT.search(said(begin, target))
        by_search = nearest_by_search(begin.chain, target)
        if match is None:
            # Printed with one decimal: what is missed by less is not looked for here.
            continue
        stretched += "the arm is stretched" in match[2]
        limited += LIMIT.search(match[2]) is not None
        assert float(match[1]) == pytest.approx(1e3 * by_search, abs=0.1, rel=2e-3)
    assert min(stretched, limited) >= 3


def test_named_axis_binds(begin: PlanState) -> None:
    """Without the limit that is named the place is nearer, and without any other one it is not."""
    chain, named = begin.chain, set()
    for target in targets(40):
        match = AMOUNT.search(said(begin, target))
        limits = [] if match is None else LIMIT.findall(match[2])
        if match is None or len(limits) != 1:
            continue
        ((number, name, shown),) = limits
        axis = int(number) - 1
        named.add(axis)
        assert name == AXIS_NAMES[axis]
        ends = np.degrees((chain.lower[axis], chain.upper[axis]))
        assert float(np.abs(ends - float(shown)).min()) < 0.006
        for other in (1, 2, 3):
            wider = np.zeros(5)
            wider[other] = 0.05
            freed = replace(chain, lower=chain.lower - wider, upper=chain.upper + wider)
            now = nearest_by_search(freed, target)
            if other == axis:
                assert 1e3 * now < float(match[1]) - 0.1
            else:
                assert 1e3 * now == pytest.approx(float(match[1]), abs=0.1, rel=2e-3)
    assert len(named) >= 2


def test_roll_beyond_its_limit_is_named(begin: PlanState) -> None:
    p: FloatArray = np.array((0.4, 0.0, 0.1))
    target = ToolTarget(p, math.radians(30.0), math.radians(175.0))
    why = said(begin, target)
    assert "the roll is 3.5 deg beyond what the arm can have" in why
    assert "axis 5, wrist roll, is at its limit of 171.5 deg" in why
    match = re.search(r"roll: ([\d.]+)}`", why)
    assert match is not None
    assert float(match[1]) == pytest.approx(171.5, abs=0.1)


def refusal(stage: Stage, steps: str) -> str:
    with pytest.raises(ScriptError) as refused:
        stage.planned(f"frame: base\nsteps:\n{steps}")
    return str(refused.value)


def test_place_of_lines_out_of_reach_is_named(stage: Stage) -> None:
    steps = "  - lines: {through: [{x: 420, y: 0, z: 300}, {x: 730, y: 0, z: 180}]}\n"
    why = refusal(stage, START + steps)
    assert "Place 2: The tool tcp cannot be at (730.0, 0.0, 180.0) mm in the base frame" in why
    assert "mm out of reach, because the arm is stretched" in why


def test_metres_are_suspected_in_a_line(stage: Stage) -> None:
    why = refusal(stage, START + "  - line: {to: {x: 0.4, y: 0, z: 0.3}}\n")
    assert "Lengths are in mm here" in why


def test_object_out_of_reach_is_reported_in_the_frame_of_the_script(stage: Stage) -> None:
    why = refusal(stage, "  - put: {object: cup, x: 650, y: 0}\n  - pick: cup\n")
    assert "(650.0, 0.0, " in why
    assert "mm in the base frame" in why


def place_refusal(begin: PlanState, frame: str, p: tuple[float, ...], pitch: float) -> str:
    """Return why the tool cannot be at ``p`` [mm] with ``pitch`` [deg]; empty if it can."""
    text = PLACE.format(frame=frame, x=p[0], y=p[1], z=p[2], pitch=pitch)
    script = parse(text)
    (step,) = script.steps
    T = begin.plan_context.T_base_shoulder
    plan = replace(begin, frame=ScriptFrame.of(T, in_base=script.in_base))
    try:
        # Only whether it can be reached; the way there is not planned.
        plan.joints_at(step.step.to)  # type: ignore[union-attr]
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.cases(1)
@pytest.mark.parametrize("frame", ["shoulder", "base"])
def test_suggested_places_are_reached(begin: PlanState, frame: str) -> None:
    rng = np.random.default_rng(19)
    points = 0
    for _ in range(60):
        *p, pitch = np.round(rng.uniform((-600, -600, -300, -90), (700, 600, 600, 90)), 1).tolist()
        why = place_refusal(begin, frame, tuple(p), pitch)
        if match := POINT.search(why):
            points += 1
            assert place_refusal(begin, frame, tuple(map(float, match.groups())), pitch) == ""
        assert not why or f"({p[0]:.1f}, {p[1]:.1f}, {p[2]:.1f}) mm in the {frame} frame" in why
    assert points > 20


@pytest.mark.parametrize(("frame", "name"), [("shoulder", "{S}"), ("base", "the base frame")])
def test_path_beyond_a_limit_is_reported_in_the_frame_of_the_script(
    stage: Stage, frame: str, name: str
) -> None:
    T = stage.plan_context.T_base_shoulder
    z = 180.0 if frame == "base" else 180.0 - 1e3 * float(T[2, 3])
    text = (
        f"frame: {frame}\ntool: tcp\nsteps:\n"
        f"  - move: {{x: 330, y: 120, z: {z}, pitch: 40, roll: 0}}\n  - line: {{by: {{y: -240}}}}\n"
    )
    with pytest.raises(ScriptError, match="over its limit") as refused:
        stage.planned(text)
    match = re.search(r"at \((\S+), (\S+), (\S+)\) mm in (.*?),", str(refused.value))
    assert match is not None
    assert match[4] == name
    assert [float(match[1]), float(match[3])] == pytest.approx([330.0, z], abs=0.1)
    assert -120.0 < float(match[2]) < 120.0


ABOVE = "frame: base\ntool: tcp\nsteps:\n  - move: {x: 320, y: 0, z: 150, pitch: 60, roll: 0}\n"


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (
            "move: {x: 320, y: 0, z: -50, pitch: 60}",
            "At the end, right finger and table would overlap by 54.3 mm, and 6 mm are required.",
        ),
        (
            "line: {to: {x: 320, y: 0, z: -50}}",
            "at (320.0, 0.0, 0.0) mm in the base frame: right finger and table would overlap by",
        ),
    ],
)
def test_point_below_the_table_is_refused_for_the_finger(
    stage: Stage, step: str, message: str
) -> None:
    with pytest.raises(ScriptError) as refused:
        stage.planned(f"{ABOVE}  - {step}\n")
    assert message in str(refused.value)
