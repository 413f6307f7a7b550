"""The examples run as they are printed, each in a process of its own, in an empty folder."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.script.script import Script, parse
from katana450.extensions.programs.script.script_files import script_text
from tests.browser.server import ROOT, AppServer
from tests.commands import completed, output
from tests.programs.conftest import Stage

EXAMPLES = ROOT / "examples"
SECONDS = 120
SLOW = ("boxes", "grid")
"""Scripts whose planning takes half a minute."""


def run(folder: Path, *command: str | Path) -> str:
    """Run a command in ``folder`` and return what it prints; it has to end well and quietly."""
    done = completed(
        [sys.executable, *(str(part) for part in command)], cwd=folder, seconds=SECONDS
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_circle_is_plotted_and_shown_until_ctrl_c(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, str(EXAMPLES / "circle.py")],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("0.628 m in")
        opened = re.search(r"http://\S+\d", process.stdout.readline())
        assert opened is not None
        with urllib.request.urlopen(opened[0], timeout=10.0) as page:
            assert page.status == 200
        assert (tmp_path / "circle.png").read_bytes().startswith(b"\x89PNG")
        # Another thread has sent the page. The one that printed the address waits soon after.
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=SECONDS)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0, said
    assert said == ""


def test_own_arm_is_solved_and_planned(tmp_path: Path) -> None:
    said = run(tmp_path, EXAMPLES / "my_own_arm.py")
    assert "my_own_arm: 5 joints, poses of the link 'tip' in the base frame" in said
    assert said.count("inside limits") == 2
    assert "out of reach" in said
    assert "1000 poses solved" in said


@pytest.mark.long
def test_arm_of_another_file_is_solved_and_planned(tmp_path: Path) -> None:
    file = ROOT / "tests" / "robot" / "arms" / "youbot_arm.urdf"
    assert "1000 poses solved" in run(tmp_path, EXAMPLES / "my_own_arm.py", file)


def test_other_mechanism_is_refused_in_a_sentence(tmp_path: Path) -> None:
    file = ROOT / "tests" / "exchange" / "gantry.urdf"
    command = [sys.executable, str(EXAMPLES / "my_own_arm.py"), str(file)]
    done = completed(command, cwd=tmp_path, seconds=SECONDS)
    assert done.returncode == 1
    assert done.stderr.startswith("This is not an arm for katana450: ")


@pytest.mark.long
def test_arm_of_a_server_is_driven(tmp_path: Path) -> None:
    with AppServer() as server:
        said = run(tmp_path, EXAMPLES / "drive_by_api.py", server.url)
    assert "At the posture: as requested." in said
    assert "At the point: as requested." in said
    missed = re.search(r"The circle is done, (\S+) rad", said)
    assert missed is not None
    assert float(missed[1]) < 1e-6


def test_notebook_runs_from_top_to_bottom(tmp_path: Path) -> None:
    notebook = tmp_path / "quickstart.ipynb"
    notebook.write_bytes((EXAMPLES / "quickstart.ipynb").read_bytes())
    execute = "from nbclient.cli import main; main()"
    command = ["-c", execute, "--timeout", str(SECONDS), "--inplace", str(notebook)]
    output([sys.executable, *command], cwd=tmp_path, seconds=2 * SECONDS)
    executed = notebook.read_text(encoding="utf-8")
    assert "image/png" in executed
    assert "<iframe" in executed
    assert '"output_type": "error"' not in executed


def test_notebook_is_kept_without_outputs() -> None:
    text = (EXAMPLES / "quickstart.ipynb").read_text(encoding="utf-8")
    assert '"output_type"' not in text


def test_every_example_is_listed() -> None:
    listed = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    for file in set(EXAMPLES.iterdir()) - {EXAMPLES / "README.md"}:
        assert file.name in listed, file.name


def test_script_is_planned_by_the_command(tmp_path: Path) -> None:
    script = EXAMPLES / "programs" / "star.yaml"
    printed = run(tmp_path, "-m", "katana450", "run", script, "--dry-run")
    assert re.search(r"^\d+ steps, about [\d.]+ s", printed, re.MULTILINE)


@pytest.fixture(scope="module")
def stage(arm: MountedArm) -> Stage:
    return Stage(arm)


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(path.stem, marks=[pytest.mark.long] if path.stem in SLOW else [])
        for path in sorted((EXAMPLES / "programs").glob("*.yaml"))
    ],
)
def test_script_can_be_planned(stage: Stage, name: str) -> None:
    program = compiled(script(name), stage.plan_context, start_of(stage, name))
    assert program.steps >= 4
    assert program.duration > 1.0


def script(name: str) -> Script:
    return parse(script_text(EXAMPLES / "programs" / f"{name}.yaml"))


def start_of(stage: Stage, name: str) -> State:
    """Return the state in which a script begins, in its scene if it has one."""
    scene = script(name).scene
    return stage.begin() if scene is None else scene.begin(stage.session)


@pytest.mark.long
def test_tower_is_knocked_over(stage: Stage) -> None:
    start = start_of(stage, "tower")
    program = compiled(script("tower"), stage.plan_context, start)
    _, states = stage.play(program, start, most=2_000)
    heights = [thing.T[2, 3] for thing in states[-1].objects]
    assert max(thing.T[2, 3] for thing in start.objects) == pytest.approx(0.16, abs=1e-3)
    assert max(heights) < 0.05


@pytest.mark.long
def test_ten_boxes_arrive_where_the_script_says(stage: Stage) -> None:
    start = start_of(stage, "boxes")
    program = compiled(script("boxes"), stage.plan_context, start)
    run, states = stage.play(program, start, most=20_000)
    assert run.phase is Phase.DONE
    before, after = (
        {thing.name: 1e3 * thing.T[:3, 3] for thing in state.objects}
        for state in (start, states[-1])
    )
    assert len(before) == 10
    # Friction holds them, and fingers that open push a box by tenths of a millimetre.
    for name, (x, y, z) in before.items():
        np.testing.assert_allclose(after[name], (x, -y, z), rtol=0, atol=0.5)
    assert all(thing.T[2, 2] == pytest.approx(1.0, abs=1e-6) for thing in states[-1].objects)
