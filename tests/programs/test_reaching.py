"""Messages about places out of reach and about contacts: what they suggest can be copied."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.language.step_target import ScriptFrame
from katana450.extensions.programs.script.script import parse
from tests.programs.conftest import Stage

PLACE = "frame: {frame}\nsteps:\n  - move: {{x: {x}, y: {y}, z: {z}, pitch: {pitch}, roll: 0}}\n"
POINT = re.compile(r"`\{x: (\S+), y: (\S+), z: (\S+)\}`")


@pytest.fixture
def begin(stage: Stage) -> PlanState:
    return PlanState(stage.plan_context, stage.begin())


def refusal(begin: PlanState, frame: str, p: tuple[float, ...], pitch: float) -> str:
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
        why = refusal(begin, frame, tuple(p), pitch)
        if match := POINT.search(why):
            points += 1
            assert refusal(begin, frame, tuple(map(float, match.groups())), pitch) == ""
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
