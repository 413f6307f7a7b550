"""The score of a pour."""

from __future__ import annotations

import math

import pytest

from katana450.extensions.programs.script.measures import water_measures
from katana450.maths.water.flow import Course, WaterFlow
from katana450.maths.water.units import MILLILITRE
from tests.water.motions import over_basin, poured, turned_to


def test_the_volumes_add_up_in_the_middle_of_a_pour(flow: WaterFlow) -> None:
    water = flow.begin(2e-4, over_basin(flow.water_environment, 0.0))
    *_, water = poured(flow, water, turned_to(2.0, 1.0), 1.2, 0.01)
    parts = (water.cup.volume, water.basin, water.air)
    assert min(parts) > 0
    assert sum(parts) + water.spilled == pytest.approx(200.0 * MILLILITRE, rel=1e-12)
    measures = water_measures(water, Course())
    assert measures["emptied_percent"] == pytest.approx(water.basin / MILLILITRE / 2.0)


def test_course_measures_duration_and_peak_jerk(flow: WaterFlow) -> None:
    course = Course()
    for k in range(201):
        t = 0.01 * k
        course = course.after((math.sin(3.0 * t), 0.0, 0.0), 0.01)
    assert course.duration == pytest.approx(2.01)
    assert course.peak_jerk == pytest.approx(3.0, rel=1e-3)
    assert course.after((9.0, 9.0, 9.0), 0.0) == course
    water = flow.begin(1e-4, over_basin(flow.water_environment, 0.0))
    assert water_measures(water, course)["cup_peak_jerk_m_s3"] == course.peak_jerk
