"""Tests of the paper's second experiment, planned for any places of cup and basin, and run."""

from __future__ import annotations

from itertools import takewhile

import numpy as np
import pytest

from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.script.measures import water_measures
from katana450.extensions.programs.steps.pouring import POURING
from katana450.maths.water.flow import Water
from katana450.maths.water.units import MILLILITRE, ML, counted
from tests.programs.conftest import Stage, pour_text


def planned(stage: Stage, **spots: tuple[float, float] | None) -> Program:
    return stage.planned(pour_text(**spots))


def check_poured(stage: Stage, program: Program, room: float = 0.0) -> None:
    """Run the program to its end; check the limits and the water at every tick.

    ``room``: angle [deg] that the joints keep from their limits.
    """
    run, states = stage.play(program, stage.begin())
    assert (run.phase, run.why) == (Phase.DONE, "")
    end, pouring = states[-1], stage.session.pouring
    assert end.t == pytest.approx(program.duration, abs=0.03 * len(program.tasks))
    assert end.poured is not None
    measures = water_measures(end.poured.water, end.poured.course)
    assert 99.5 <= measures["emptied_percent"] <= 100.0
    assert measures["spilled_ml"] == 0.0
    # The water surface stays below the lip until the cup is turned over to pour.
    (turned,) = (task.action for task in program.tasks if task.name == POURING)
    assert isinstance(turned, FollowPlan)
    plan = turned.plan
    carried = list(takewhile(lambda s: s.following is None or s.following.plan is not plan, states))
    assert pouring is not None
    margins = [pouring.margin_to_rim(s.poured, s.objects) for s in carried if s.poured is not None]
    assert len(margins) > 300
    assert min(margins) > 0.005
    assert stage.loads(states).max() <= 1.0 + 1e-6
    chain, q = stage.plan_context.arm.chain, np.array([state.setpoint for state in states])
    assert np.degrees(np.minimum(q - chain.lower, chain.upper - q)).min() >= room
    (cup,) = (candidate for candidate in end.objects if candidate.name == "cup")
    stood = [t for s in carried for t in s.objects if t.name == "cup" and not t.held][-1]
    assert not cup.held
    # The finger that leaves it last pushes it by some tenths of a millimetre.
    np.testing.assert_allclose(cup.T, stood.T, rtol=0, atol=2e-3)


def test_all_water_reaches_the_basin_and_none_the_table(stage: Stage) -> None:
    check_poured(stage, planned(stage), room=2.0)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("cup", "basin", "said"),
    [
        ((740.0, 0.0), None, "cup cannot be grasped at its place"),
        ((900.0, 0.0), None, "nothing carries it there"),
        (None, (740.0, 600.0), "cannot be emptied into basin"),
        ((220.0, 360.0), None, "cup would stand in basin"),
    ],
)
def test_invalid_start_scene_is_refused_before_motion(
    stage: Stage, cup: tuple[float, float] | None, basin: tuple[float, float] | None, said: str
) -> None:
    with pytest.raises(ScriptError) as refused:
        planned(stage, cup=cup, basin=basin)
    (problem,) = refused.value.problems
    assert said in problem.text
    assert problem.line > 0


PART = """\
frame: base
steps:
- fill: {0}
- grasp: cup
- line: {{by: {{z: 140}}}}
{1}- set_down
- home
"""
"""A script that fills the cup [ml] and has steps in which it is poured."""


def poured(stage: Stage, full: float, *parts: float) -> Water:
    """Pour parts of a cup [ml] into the basin; return the water at the end."""
    pours = "".join(f"- pour: {{into: basin, ml: {part:g}}}\n" for part in parts)
    program = stage.planned(PART.format(full, pours))
    run, states = stage.play(program, stage.begin(), most=20_000)
    assert run.phase is Phase.DONE
    assert states[-1].poured is not None
    return states[-1].poured.water


@pytest.mark.long
@pytest.mark.parametrize("full", [60.0, 220.0])
def test_half_of_the_water_is_poured(stage: Stage, full: float) -> None:
    water = poured(stage, full, 0.5 * full)
    assert water.basin / MILLILITRE == pytest.approx(0.5 * full, rel=0.01)
    assert water.spilled == 0
    assert water.total == counted(full * ML)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("pour", "message"),
    [
        ("- pour: {into: basin, ml: 120}\n", "The cup holds 100.0 ml at this step.* 120 ml"),
        ("- pour: basin\n- pour: {into: basin, ml: 5}\n", "The cup holds 0.0 ml at this step"),
        ("- pour: {into: basin, ml: 50, shake: 2}\n", "leave out `shake` or `ml`"),
        ("- pour: {into: basin, ml: 0}\n", "0 is not between 1 and 1000 ml"),
    ],
)
def test_part_that_cannot_be_poured_is_refused(stage: Stage, pour: str, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        stage.planned(PART.format(100, pour))
