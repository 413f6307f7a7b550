"""The extension that docs/extensions.md prints is installed as printed and used on a server."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from katana450.client import connect
from katana450.server.api import answers
from katana450.server.api.fields import ROOT
from tests.browser.server import RECORDING_APP, AppServer
from tests.docs.code_blocks import code_blocks
from tests.gateway.client import ask
from tests.gateway.lines import post


def write_printed(folder: Path) -> None:
    """Write the files of the distribution whose parts are printed one after the other."""
    files: dict[str, str] = {}
    for block in code_blocks("python", "toml"):
        printed = re.match(r"# ([\w/]+\.\w+)\n", block.text)
        if block.document == "docs/extensions.md" and printed is not None:
            # A later distribution has a pyproject.toml of its own.
            files.setdefault(printed[1], block.text)
    files = {name: text for name, text in files.items() if not name.startswith("weather")}
    assert sorted(files) == ["nodding/__init__.py", "nodding/nodder.py", "pyproject.toml"]
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def test_printed_request_is_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_printed(tmp_path / "printed")
    site = tmp_path / "site"
    # Without the network: the build backend of this environment, and no environment to change.
    own = ("--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--target", str(site))
    install = [sys.executable, "-m", "pip", "install", *own, "."]
    subprocess.run(install, cwd=tmp_path / "printed", check=True, timeout=120)
    monkeypatch.setenv("PYTHONPATH", str(site))
    with AppServer(RECORDING_APP) as server, connect(server.url, "Watcher") as watcher:
        goal = watcher.query(answers.State).goal[3] + 0.1
        status, done = post(server, do="nod", by=0.1)
        assert (status, done["is"]) == (200, "done"), done
        due = time.monotonic() + 20.0
        while abs(watcher.query(answers.State).q[3] - goal) > 1e-6:
            assert time.monotonic() < due
            time.sleep(0.01)
        described = json.loads(ask(f"{server.url}{ROOT}/openapi.json")[2])["components"]["schemas"]
        assert described["Nod"]["properties"]["by"]
