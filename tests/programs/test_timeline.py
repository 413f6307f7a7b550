"""Tests of the objects and the water at the times of a program."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from katana450.arm.control.state.state import ActiveStop
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.simulation import Moment, Timeline, moments
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.maths.water.units import MILLILITRE
from tests.programs.conftest import Stage


@pytest.fixture(scope="module")
def poured(stage: Stage) -> tuple[Program, Timeline, list[Moment]]:
    program = stage.planned(script_text(library_file("pour")))
    timeline = Timeline.of(program)
    return program, timeline, list(moments(program, timeline, stage.session, stage.begin()))


def test_moments_are_on_the_clock_of_the_plans(
    poured: tuple[Program, Timeline, list[Moment]],
) -> None:
    program, timeline, moments = poured
    assert timeline.span == pytest.approx(program.duration)
    assert [moment.t for moment in moments] == sorted(moment.t for moment in moments)
    assert moments[-1].t == pytest.approx(timeline.span)
    for moment in moments:
        # At full speed and 20 ms between the states; the pour itself is slower.
        np.testing.assert_allclose(timeline.at(moment.t)[0], moment.state.q, rtol=0, atol=5e-3)


def test_cup_is_carried_and_emptied(
    stage: Stage, poured: tuple[Program, Timeline, list[Moment]]
) -> None:
    _, timeline, moments = poured
    carried = [moment.t for moment in moments if any(o.held for o in moment.state.objects)]
    assert 0.1 * timeline.span < carried[0] < carried[-1] < timeline.span
    levels = [
        (moment.state.poured.water.cup.volume, moment.state.poured.water.basin)
        for moment in moments
        if moment.state.poured is not None
    ]
    assert levels[0][0] == pytest.approx(200 * MILLILITRE, abs=1)
    assert levels[0][1] == 0
    # A film of less than a millilitre stays in the cup.
    assert levels[0][0] - MILLILITRE < levels[-1][1] < levels[0][0]
    assert all(before[1] <= after[1] for before, after in pairwise(levels))
    # The cup is in the hand wherever it is held.
    for moment in moments:
        for scene_object in moment.state.objects:
            if scene_object.held:
                T = stage.session.environment.pose(scene_object, moment.state.x)
                assert np.linalg.norm(T[:3, 3]) > 0.2
                assert T[2, 3] > -1e-3


def test_stop_and_pause_of_the_arm_do_not_hinder_the_preview(stage: Stage) -> None:
    text = "steps:\n  - joints: [20, -68, 85, 8, 0]\n  - wait: 1\n  - joints: [0, -68, 85, 8, 0]"
    program = stage.planned(text)
    timeline = Timeline.of(program)
    state = replace(stage.begin(), stopped=ActiveStop(0.0, 0.0), paused=True, speed=0.1)
    *_, last = moments(program, timeline, stage.session, state)
    assert last.t == pytest.approx(timeline.span)
    assert last.state.stopped is None


def test_preview_of_a_failing_program_ends_there(stage: Stage) -> None:
    program = stage.planned("steps: [home]")
    assert [
        moment.t for moment in moments(program, Timeline.of(program), stage.session, stage.begin())
    ] == [0.0]
    text = "steps:\n  - joints: [20, -68, 85, 8, 0]\n  - joints: [0, -68, 85, 8, 0]"
    program = stage.planned(text)
    timeline = Timeline.of(program)
    # The arm stands elsewhere by now.
    q = stage.begin().setpoint + 0.3
    moved = stage.session.begin(q, 0.0, 0.0)
    *_, last = moments(program, timeline, stage.session, moved)
    assert last.t == 0.0
    np.testing.assert_allclose(last.state.q, q)
