"""The paper's second experiment, planned from where cup and basin stand, and run to its end."""

from __future__ import annotations

import numpy as np
import pytest

from app.programs.pour import PourDemo, Spot
from app.programs.program import Program, compiled
from app.programs.runner import Phase
from app.programs.script import parse
from app.programs.source import ScriptError
from app.water.score import score
from tests.programs.conftest import Stage


def planned(stage: Stage, cup: Spot | None = None, basin: Spot | None = None) -> Program:
    text = PourDemo(cup=cup, basin=basin).text
    return compiled(parse(text), stage.rig, stage.begin())


def test_all_of_it_gets_into_the_basin_and_none_on_the_table(stage: Stage) -> None:
    program = planned(stage)
    run, states = stage.play(program, stage.begin())
    assert run.phase is Phase.DONE, run.why
    end = states[-1]
    assert end.poured is not None
    found = score(end.poured.water, end.poured.course)
    assert found.emptied_percent >= 99.0
    assert found.spilled_ml == 0.0
    assert stage.session.pouring is not None
    carried = [
        stage.session.pouring.margin_to_rim(state.poured, state.things)
        for state in states
        if state.poured is not None and state.poured.water.basin + state.poured.water.air == 0
    ]
    # Until it is poured on purpose the surface comes to the lip from below, and no sooner.
    assert min(carried[: len(carried) * 3 // 4]) > 0.005
    (cup,) = (each for each in end.things if each.name == "cup")
    (stood,) = (each for each in states[0].things if each.name == "cup")
    assert not cup.held
    np.testing.assert_allclose(cup.T, stood.T, rtol=0, atol=1e-6)
    limits = stage.rig.arm.limits
    qd = np.array([state.motion.qd for state in states])
    assert (np.abs(qd) <= limits.speed + 1e-9).all()


@pytest.mark.parametrize(
    ("cup", "basin", "said"),
    [
        ((900.0, 0.0), None, "cup cannot be taken where it stands"),
        ((120.0, 0.0), None, "cup cannot be taken where it stands"),
        (None, (900.0, 100.0), "cannot be emptied into basin"),
        ((220.0, 360.0), None, "cup would stand in basin"),
    ],
)
def test_what_stands_badly_is_refused_before_anything_moves(
    stage: Stage, cup: Spot | None, basin: Spot | None, said: str
) -> None:
    with pytest.raises(ScriptError) as refused:
        planned(stage, cup, basin)
    (problem,) = refused.value.problems
    assert said in problem.said
    assert problem.line > 0
