"""Tests of cup and basin at random places: all water reaches the basin, or a script is refused."""

from __future__ import annotations

import math
import os
import random

import pytest

from katana450.extensions.programs.pour import PourDemo, Spot
from katana450.extensions.programs.program import compiled
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.source import ScriptError
from tests.programs.conftest import Stage
from tests.programs.test_pour import check_poured

CASES = range(50) if "KATANA450_LONG" in os.environ else (1, 2)
"""Cases: cup out of reach, cup beyond the table.

`KATANA450_LONG` runs all of them.
"""


def spots(number: int) -> tuple[Spot, Spot]:
    """Return random places [mm] around the arm, within its reach and somewhat beyond."""
    rng = random.Random(number)

    def spot() -> Spot:
        radius, angle = rng.uniform(280.0, 560.0), rng.uniform(-2.6, 2.6)
        return radius * math.cos(angle), radius * math.sin(angle)

    return spot(), spot()


@pytest.mark.parametrize("number", CASES)
def test_every_place_is_poured_from_or_refused(stage: Stage, number: int) -> None:
    cup, basin = spots(number)
    try:
        program = compiled(
            parse(PourDemo(cup=cup, basin=basin).text), stage.plan_context, stage.begin()
        )
    except ScriptError as error:
        (problem,) = error.problems
        assert problem.line > 0
        assert any(each in problem.text for each in REASONS), problem.text
        return
    check_poured(stage, program)


REASONS = (
    "cannot be grasped at its place",
    "cannot be emptied into",
    "would stand in",
    "no room",
    "nothing carries it there",
)
