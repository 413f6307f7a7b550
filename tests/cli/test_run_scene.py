"""``katana450 run --scene``: a script is rehearsed in the scene of a file, without a server."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.browser.server import AppServer

ROOT = Path(__file__).resolve().parents[2]

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
    return subprocess.run(
        [sys.executable, "-m", "katana450", "run", *map(str, options)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120.0,
        check=False,
    )


def test_line_through_an_object_of_the_scene_is_refused(script: Path, post: Path) -> None:
    assert run(script, "--dry-run").returncode == 0
    done = run(script, "--dry-run", "--scene", post)
    assert done.returncode == 1
    assert f"{script}:5:" in done.stderr
    assert "post" in done.stderr


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


def test_scene_that_cannot_be_used_is_named(script: Path, post: Path, tmp_path: Path) -> None:
    missing = tmp_path / "nowhere.yaml"
    done = run(script, "--dry-run", "--scene", missing)
    assert done.returncode == 1
    assert str(missing) in done.stderr
    post.write_text(POST.replace("box", "bax"), encoding="utf-8")
    done = run(script, "--dry-run", "--scene", post)
    assert done.returncode == 1
    assert "bax" in done.stderr
    assert f"{post.name}:" in done.stderr


@pytest.mark.long
def test_running_server_keeps_its_scene(script: Path, post: Path) -> None:
    with AppServer() as server:
        done = run(script, "--scene", post, "--url", server.url)
    assert done.returncode == 1
    assert "has a scene already" in done.stderr
