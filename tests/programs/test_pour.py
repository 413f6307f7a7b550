"""Tests of the paper's second experiment, planned for any places of cup and basin, and run."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest

import katana450.extensions.programs
from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.pour import PourDemo, Spot
from katana450.extensions.programs.pouring import POURING
from katana450.extensions.programs.program import Program, compiled
from katana450.extensions.programs.runner import Phase
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.source import ScriptError
from katana450.maths.water.score import score
from tests.programs.conftest import Stage


def planned(stage: Stage, cup: Spot | None = None, basin: Spot | None = None) -> Program:
    text = PourDemo(cup=cup, basin=basin).text
    return compiled(parse(text), stage.plan_context, stage.begin())


def check_poured(stage: Stage, program: Program) -> None:
    """Run the program to its end; check the limits and the water at every tick."""
    run, states = stage.play(program, stage.begin())
    assert (run.phase, run.why) == (Phase.DONE, "")
    end, pouring = states[-1], stage.session.pouring
    assert end.poured is not None
    found = score(end.poured.water, end.poured.course)
    assert found.emptied_percent >= 99.0
    assert found.spilled_ml == 0.0
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
    (cup,) = (each for each in end.objects if each.name == "cup")
    stood = [t for s in carried for t in s.objects if t.name == "cup" and not t.held][-1]
    assert not cup.held
    np.testing.assert_allclose(cup.T, stood.T, rtol=0, atol=1e-6)


def test_all_water_reaches_the_basin_and_none_the_table(stage: Stage) -> None:
    check_poured(stage, planned(stage))


def test_the_script_of_the_library_is_the_demo() -> None:
    path = Path(katana450.extensions.programs.__file__).parent / "library" / "pour.yaml"
    stored, demo = parse(path.read_text(encoding="utf-8")), parse(PourDemo().text)
    assert stored.expected == demo.expected
    assert [repr(a.step) for a in stored.steps] == [repr(b.step) for b in demo.steps]


@pytest.mark.parametrize(
    ("cup", "basin", "said"),
    [
        ((740.0, 0.0), None, "cup cannot be grasped at its place"),
        ((900.0, 0.0), None, "nothing carries it there"),
        ((120.0, 0.0), None, "cup cannot be grasped at its place"),
        (None, (740.0, 600.0), "cannot be emptied into basin"),
        ((220.0, 360.0), None, "cup would stand in basin"),
    ],
)
def test_invalid_start_scene_is_refused_before_motion(
    stage: Stage, cup: Spot | None, basin: Spot | None, said: str
) -> None:
    with pytest.raises(ScriptError) as refused:
        planned(stage, cup, basin)
    (problem,) = refused.value.problems
    assert said in problem.text
    assert problem.line > 0
