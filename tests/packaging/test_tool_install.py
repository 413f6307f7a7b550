"""An installation by `uv tool install`, without make, has a working command and serves the page."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from tests.browser.server import AppServer

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the checkout with its locked dependencies as a tool; return its command."""
    home = tmp_path_factory.mktemp("tool")
    folders = {"UV_TOOL_DIR": str(home / "tools"), "UV_TOOL_BIN_DIR": str(home / "bin")}
    uv = [sys.executable, "-m", "uv", "tool", "install", "--quiet", "--python", sys.executable]
    done = subprocess.run(
        [*uv, "--constraints", str(ROOT / "requirements.lock"), str(ROOT)],
        env=os.environ | folders,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    found = shutil.which("katana450", path=home / "bin")
    assert found is not None
    return Path(found)


@pytest.mark.long
def test_tool_computes_and_serves(command: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [str(command), "fk"],
        input='{"q": [0, 0, 0, 0, 0]}\n',
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert '"T": [[1.0, ' in done.stdout
    with AppServer([str(command), "serve", "--port", "{port}"], folder=tmp_path) as server:
        with urllib.request.urlopen(server.url, timeout=30) as answer:
            assert b"katana450" in answer.read().lower()
        assert server.running
