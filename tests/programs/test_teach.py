"""Tests of scripts from taught postures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from katana450.errors import ConfigurationError, InputError
from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.program import compiled
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.script_files import LIBRARY, Scripts
from katana450.extensions.programs.teach import script_from_postures
from tests.programs.conftest import Stage


def test_a_taught_script_goes_through_the_postures(stage: Stage) -> None:
    ready = stage.session.ready
    postures = [ready + 0.1, ready - 0.123456, ready]
    program = compiled(
        parse(script_from_postures("Shown", postures)), stage.plan_context, stage.begin()
    )
    ends = [task.action.plan.end for task in program.tasks if isinstance(task.action, FollowPlan)]
    assert program.name == "Shown"
    assert np.abs(np.array(ends) - postures).max() < np.radians(6e-4)


def test_a_saved_script_is_listed(tmp_path: Path) -> None:
    scripts = Scripts(tmp_path)
    text = script_from_postures("Mine", [np.zeros(5)])
    scripts.save("Mine", text)
    assert next(iter(scripts.paths)) == "Mine"
    assert scripts.text("Mine") == text
    assert len(scripts.paths) == 1 + len(list(LIBRARY.glob("*.yaml")))


@pytest.mark.parametrize("name", ["", "../out", "a/b", ".hidden", "x" * 41, "a\nb", "Mine"])
def test_an_invalid_name_is_refused(tmp_path: Path, name: str) -> None:
    scripts = Scripts(tmp_path)
    scripts.save("Mine", "steps: [home]")
    with pytest.raises(InputError):
        scripts.save(name, "steps: [home]")
    assert [path.name for path in tmp_path.iterdir()] == ["Mine.yaml"]


def test_without_a_folder_nothing_is_saved(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--programs"):
        Scripts().save("Mine", "steps: [home]")
    with pytest.raises(InputError, match="no longer exists"):
        Scripts().text("Mine")
    with pytest.raises(ConfigurationError, match="--programs"):
        Scripts(tmp_path / "none")
