"""Installations without make have a working command, serve the page and move the arm."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import urllib.request
import venv
import zipfile
from pathlib import Path

import pytest

from katana450.client import connect
from katana450.server.api import answers
from tests.browser.server import AppServer
from tests.commands import completed, output
from tests.packaging.conftest import ROOT, build


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the checkout with its locked dependencies as a tool; return its command."""
    home = tmp_path_factory.mktemp("tool")
    folders = {"UV_TOOL_DIR": str(home / "tools"), "UV_TOOL_BIN_DIR": str(home / "bin")}
    uv = [sys.executable, "-m", "uv", "tool", "install", "--quiet", "--python", sys.executable]
    output(
        [*uv, "--constraints", str(ROOT / "requirements.lock"), str(ROOT)], env=folders, seconds=600
    )
    command = shutil.which("katana450", path=home / "bin")
    assert command is not None
    return Path(command)


@pytest.mark.long
def test_tool_computes_and_serves(command: Path, tmp_path: Path) -> None:
    done = completed([str(command), "fk"], cwd=tmp_path, text='{"q": [0, 0, 0, 0, 0]}\n')
    assert done.returncode == 0, done.stderr
    assert '"T": [[1.0, ' in done.stdout
    with AppServer([str(command), "serve", "--port", "{port}"], folder=tmp_path) as server:
        with urllib.request.urlopen(server.url, timeout=30) as answer:
            assert b"katana450" in answer.read().lower()
        assert server.running


@pytest.mark.long
def test_wheel_from_the_source_distribution_moves_an_arm(wheel: Path, tmp_path: Path) -> None:
    """Install it by pip into an empty environment, with the newest dependencies that it allows."""
    with tarfile.open(build("sdist", ROOT, tmp_path)) as source:
        source.extractall(tmp_path / "source", filter="data")
    (folder,) = (tmp_path / "source").iterdir()
    built = build("wheel", folder, tmp_path / "dist")
    first, second = (set(zipfile.ZipFile(wheel_path).namelist()) for wheel_path in (wheel, built))
    assert first == second
    assert list((folder / "docs" / "images").glob("*.webp"))

    python = tmp_path / "empty" / "bin" / "python"
    venv.create(tmp_path / "empty", with_pip=True)
    pip = [str(python), "-m", "pip", "install", "--quiet", str(built)]
    done = subprocess.run(pip, capture_output=True, text=True, check=False, timeout=900)
    assert done.returncode == 0, done.stderr
    command = [str(python.with_name("katana450")), "serve", "--no-browser", "--port", "{port}"]
    with AppServer(command, folder=tmp_path) as server, connect(server.url) as arm:
        target = [0.4, -1.0, 1.4, 0.3, 0.0]
        assert arm.joints(target).why == ""
        assert arm.query(answers.State).q == pytest.approx(target, abs=1e-3)
