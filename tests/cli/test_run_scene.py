"""``katana450 run --scene``: a script is rehearsed in the scene of a file, without a server."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from katana450.cli.main import main
from tests.browser.server import AppServer, free_port
from tests.commands import completed

SCRIPT = """\
frame: base
tool: tcp
steps:
  - move: {x: 320, y: -100, z: 150, pitch: 50, roll: 0}
  - line: {by: {y: 200}}
"""

POST = """\
scene: 1
joints: [10, -68, 85, 8, 0]
objects:
- name: post
  shape: box
  size: [30, 30, 250]
  pose: [330, 0, 0, 0, 0, 0]
"""


SCENE_OF_THE_SCRIPT = """\
scene:
  - {name: post, shape: box, size: [30, 30, 250], pose: [330, 0, 0, 0, 0, 0]}
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "across.yaml"
    path.write_text(SCRIPT, encoding="utf-8")
    return path


@pytest.fixture
def post(tmp_path: Path) -> Path:
    path = tmp_path / "scene.yaml"
    path.write_text(POST, encoding="utf-8")
    return path


def run(*options: str | Path) -> subprocess.CompletedProcess[str]:
    return completed([sys.executable, "-m", "katana450", "run", *map(str, options)], seconds=120.0)


def test_line_through_an_object_of_the_scene_is_refused(
    script: Path, post: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", str(script), "--dry-run"]) == 0
    assert main(["run", str(script), "--dry-run", "--scene", str(post)]) == 1
    said = capsys.readouterr().err
    assert f"{script}:5:" in said
    assert "post" in said


@pytest.mark.long
def test_simulation_begins_at_the_joints_of_the_scene(
    script: Path, post: Path, tmp_path: Path
) -> None:
    aside = post.read_text(encoding="utf-8").replace("[330, 0,", "[330, 300,")
    post.write_text(aside, encoding="utf-8")
    done = run(script, "--headless", "--scene", post, "--report", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    _, first, *_ = (tmp_path / "out" / "trace.csv").read_text(encoding="utf-8").splitlines()
    assert ",10.0," in first


def test_scene_that_cannot_be_used_is_named(
    script: Path, post: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = str(tmp_path / "nowhere.yaml")
    assert main(["run", str(script), "--dry-run", "--scene", missing]) == 1
    assert missing in capsys.readouterr().err
    post.write_text(POST.replace("box", "bax"), encoding="utf-8")
    assert main(["run", str(script), "--dry-run", "--scene", str(post)]) == 1
    said = capsys.readouterr().err
    assert "bax" in said
    assert f"{post.name}:" in said


def test_scene_of_the_script_is_used_unless_another_is_given(
    script: Path, post: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script.write_text(f"{SCENE_OF_THE_SCRIPT}{SCRIPT}", encoding="utf-8")
    assert main(["run", str(script), "--dry-run"]) == 1
    said = capsys.readouterr().err
    assert f"{script}:7:" in said
    assert "post" in said
    post.write_text(POST.replace("[330, 0,", "[330, 300,"), encoding="utf-8")
    assert main(["run", str(script), "--dry-run", "--scene", str(post)]) == 0
    assert main(["run", str(script), "--scene", str(post)]) == 1
    assert "the script has a scene of its own" in capsys.readouterr().err


def test_conditions_are_listed_with_the_tasks_that_follow(
    script: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    choice = "  - if: {held: cup, then: [{nudge: {axis: 5, by: 5}}, home]}\n"
    script.write_text(f"{SCRIPT}{choice}  - home\n", encoding="utf-8")
    assert main(["run", str(script), "--dry-run"]) == 0
    listed = capsys.readouterr().out
    match = re.search(r"line    6  if cup in the hand +then (\d+), else (\d+)\n", listed)
    assert match is not None
    for number, task in zip(match.groups(), ("line    6  nudge", "line    7  home"), strict=True):
        assert re.search(rf"^ +{number}  {task}", listed, re.MULTILINE)
    assert re.search(r"^7 steps, about [\d.]+ s", listed, re.MULTILINE)


@pytest.mark.long
def test_report_measures_only_the_alternative_that_was_taken(script: Path, tmp_path: Path) -> None:
    up, down = ("line: {by: {z: 40}}", "line: {by: {z: -25}}")
    choice = f"  - if: {{held: cup, then: [{{{up}}}], else: [{{{down}}}]}}\n"
    script.write_text(f"{SCRIPT}{choice}", encoding="utf-8")
    done = run(script, "--headless", "--report", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "Line 6, if cup in the hand: else." in done.stdout
    report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert report["path_length_mm"] == pytest.approx(225.0)
    assert "Line 6, if cup in the hand: else." in report["notes"]


@pytest.mark.long
def test_server_is_started_with_the_scene_of_the_script(script: Path, post: Path) -> None:
    nudge = "steps:\n  - nudge: {axis: 5, by: 5}\n"
    script.write_text(SCENE_OF_THE_SCRIPT.replace("[330, 0,", "[330, 300,") + nudge, "utf-8")
    url = f"http://127.0.0.1:{free_port()}"
    done = run(script, "--url", url)
    assert done.returncode == 0, done.stderr
    script.write_text(nudge, encoding="utf-8")
    post.write_text(POST.replace("[330, 0,", "[330, 300,"), encoding="utf-8")
    done = run(script, "--url", url, "--scene", post)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
def test_running_server_keeps_its_scene(script: Path, post: Path) -> None:
    with AppServer() as server:
        done = run(script, "--scene", post, "--url", server.url)
    assert done.returncode == 1
    assert "has a scene already" in done.stderr
