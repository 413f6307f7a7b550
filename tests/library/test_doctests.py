"""The examples in the docstrings of the library run as they are printed."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import katana450
from katana450 import library
from tests.recording.sessions import drag, record_session

MODULES = [
    *(f"katana450.library.{module.name}" for module in pkgutil.iter_modules(library.__path__)),
    "katana450.maths.kinematics.pose",
]

METHODS = ("fk", "ik", "nearest", "jacobian", "plan", "line", "circle", "reachability", "show")

MUST_HAVE = {f"katana450.library.arm.Arm.{name}" for name in METHODS} | {
    f"katana450.library.{name}"
    for name in (
        "recording.Recording.fork",
        "arm.load",
        "motion_plan.MotionPlan.sample",
        "motion_plan.MotionPlan.plot",
    )
}
MUST_HAVE.add("katana450.maths.kinematics.pose.SE3")

FINDER = doctest.DocTestFinder(exclude_empty=True)

EXAMPLES = [
    example
    for name in MODULES
    for example in FINDER.find(importlib.import_module(name), name)
    if example.examples
]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_session(tmp_path_factory.mktemp("recorded") / "run.mcap", 150, drag(150))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_examples_in_docstrings_run(
    example: doctest.DocTest,
    shoulder_arm: katana450.Arm,
    recorded: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    mpl.use("Agg")
    example.globs.update(katana450=katana450, np=np, arm=shoulder_arm, path=recorded)
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    result = doctest.DocTestRunner(optionflags=flags).run(example, out=print)
    assert result.attempted > 0
    assert result.failed == 0, capsys.readouterr().out


def test_every_method_that_computes_has_an_example() -> None:
    assert {example.name for example in EXAMPLES} >= MUST_HAVE
