"""Messages about contacts name the pair that violates most, for people, in the script's frame."""

from __future__ import annotations

import pytest

from katana450.extensions.programs.program import compiled
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.source import ScriptError
from tests.programs.conftest import Stage

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
        compiled(parse(f"{ABOVE}  - {step}\n"), stage.plan_context, stage.begin())
    assert message in str(refused.value)
