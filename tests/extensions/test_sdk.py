"""The example of an extension, installed as a distribution, and the module that it is made with."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

from katana450 import sdk
from katana450.client import connect
from katana450.server.api import answers
from katana450.server.api.fields import ROOT as ROOT_PATH
from tests.browser.server import RECORDING_APP, AppServer
from tests.commands import modules_after
from tests.gateway.client import ask
from tests.gateway.lines import post
from tests.waiting import until

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "nodding"

SCRIPT = "name: nods\nsteps:\n  - nod: {by: 5}\n"


def test_every_name_of_the_sdk_is_there() -> None:
    assert 35 <= len(sdk.__all__) <= 50
    for name in sdk.__all__:
        assert getattr(sdk, name).__doc__, name
        assert name in dir(sdk)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = sdk.nonsense  # type: ignore[attr-defined]


def test_documentation_describes_every_name_of_the_sdk() -> None:
    text = (EXAMPLE.parents[1] / "docs" / "extensions.md").read_text("utf-8")
    assert [name for name in sdk.__all__ if f"`{name}`" not in text] == []


def test_registration_loads_nothing_heavy() -> None:
    assert not modules_after("import nodding", EXAMPLE) & {"numpy", "viser", "yaml"}


def test_example_imports_the_sdk_alone() -> None:
    modules = {
        node.module
        for file in EXAMPLE.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom)
    }
    assert {name for name in modules if str(name).startswith("katana450")} == {"katana450.sdk"}


def test_installed_example_adds_a_request_and_a_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "site"
    # Without the network: the build backend of this environment, and no environment to change.
    own = ("--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--target", str(site))
    install = [sys.executable, "-m", "pip", "install", *own, str(EXAMPLE)]
    subprocess.run(install, check=True, timeout=120)
    monkeypatch.setenv("PYTHONPATH", str(site))
    script = tmp_path / "nods.yaml"
    script.write_text(SCRIPT, "utf-8")
    run = [sys.executable, "-m", "katana450", "run", str(script), "--headless"]
    done = subprocess.run(run, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    with AppServer(RECORDING_APP) as server, connect(server.url, "Watcher") as watcher:
        goal = watcher.query(answers.State).goal[3] + 0.1
        status, answer = post(server, do="nod", by=0.1)
        assert (status, answer["is"]) == (200, "done"), answer
        until(lambda: abs(watcher.query(answers.State).q[3] - goal) <= 1e-6, 20.0)
        described = json.loads(ask(f"{server.url}{ROOT_PATH}/openapi.json")[2])
        assert described["components"]["schemas"]["Nod"]["properties"]["by"]
