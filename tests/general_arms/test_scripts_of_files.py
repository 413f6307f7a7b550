"""Script files for arms outside the five-axis family, simulated with the links of their URDF."""

from __future__ import annotations

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser
from jsonschema import Draft202012Validator

from katana450.errors import KatanaError
from katana450.extensions.programs.run.simulation import plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse, script_schema
from katana450.extensions.programs.script.script_files import script_text
from katana450.extensions.programs.server.preview import PreviewNodes
from katana450.extensions.programs.server.traces import TracesLayer, coloured
from katana450.maths.kinematics.chain import Chain
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.links_of_arms import ur5e
from tests.general_arms.published_arms import OPENMANIPULATOR_X
from tests.programs.yaml_core import loaded
from tests.viser_bridge import internals

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "examples" / "programs" / "other_arms" / "ur5e.yaml"


@pytest.fixture
def ur5e_file(tmp_path: Path) -> Path:
    path = tmp_path / "ur5e.urdf"
    path.write_text(ur5e(), encoding="utf-8")
    return path


def test_example_is_valid_for_editors() -> None:
    text = SCRIPT.read_text(encoding="utf-8")
    assert Draft202012Validator(script_schema()).is_valid(loaded(text))
    assert "$schema=../script.schema.json" in text


def test_preview_and_trace_show_the_curves(server: viser.ViserServer, ur5e_file: Path) -> None:
    plan = plan_script(parse(script_text(SCRIPT)), ur5e_file)
    states = run_by_clock(plan).states
    preview = PreviewNodes(server, plan.robot, lambda: plan.session)
    preview.show(plan.program, plan.start)
    span = plan.program.duration
    assert span == pytest.approx(states[-1].t, abs=0.3)
    preview.look(0.5 * span)
    for thread in [candidate for candidate in threading.enumerate() if candidate.name == "preview"]:
        thread.join(30.0)
    traces = TracesLayer()
    context: Any = SimpleNamespace(server=server, robot=plan.robot)
    traces.attach(context)
    for state in states:
        traces.follow(state)
    nodes = internals.nodes(server)
    traced = nodes["/path/traced"]
    assert isinstance(traced, viser.LineSegmentsHandle)
    assert traced.visible
    # Green all along: the tool is on its curve.
    assert (traced.colors.reshape(-1, 3) == coloured(np.zeros(1))).all()
    shown = nodes["/path/preview"]
    assert isinstance(shown, viser.LineSegmentsHandle)
    down = shown.points.reshape(-1, 3)[:, 2].min()
    assert down == pytest.approx(0.2, abs=1e-3)
    preview.begin()


def test_robot_without_a_tool_runs_no_script(tmp_path: Path) -> None:
    path = tmp_path / "two.urdf"
    path.write_text(chain_urdf("two", _first(OPENMANIPULATOR_X, 2)), encoding="utf-8")
    with pytest.raises(KatanaError, match="axes"):
        plan_script(parse("steps:\n  - home\n"), path)


def _first(chain: Chain, n: int) -> Chain:
    return Chain(
        chain.M, chain.S[:, :n], chain.lower[:n], chain.upper[:n], chain.speed[:n], chain.names[:n]
    )
