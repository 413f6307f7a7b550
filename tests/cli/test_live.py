"""``katana450 run`` and ``demo`` start a server if none is running."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from katana450.cli.main import main
from katana450.extensions.experiments import live, simulate
from tests.browser.server import free_port

KATANA450 = str(Path(sys.executable).parent / "katana450")
SCRIPT = "steps:\n  - gripper: open\n"


def run(folder: Path, url: str) -> subprocess.CompletedProcess[str]:
    script = folder / "script.yaml"
    script.write_text(SCRIPT, encoding="utf-8")
    return subprocess.run(
        [KATANA450, "run", script.name, "--url", url],
        capture_output=True,
        text=True,
        cwd=folder,
        timeout=90,
        check=False,
    )


def test_server_is_started_beside_an_app_py_of_the_user(tmp_path: Path) -> None:
    (tmp_path / "app.py").write_text("open('run-by-mistake', 'w').close()\n", encoding="utf-8")
    done = run(tmp_path, f"http://127.0.0.1:{free_port()}")
    assert not (tmp_path / "run-by-mistake").exists()
    assert done.returncode == 0, done.stderr
    assert "Done." in done.stdout


def test_server_of_another_machine_is_never_started(tmp_path: Path) -> None:
    done = run(tmp_path, f"http://localhost.invalid:{free_port()}")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "localhost.invalid" in done.stderr


def test_report_without_headless_says_that_it_drives_a_server(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    script = tmp_path / "script.yaml"
    script.write_text(SCRIPT, encoding="utf-8")
    monkeypatch.setattr(simulate, "simulate", lambda *_: simulate.Simulated(0))
    monkeypatch.setattr(live, "run_live", lambda *_: 0)
    for options, drives in (((), True), (("--headless",), False)):
        assert main(["run", str(script), "--report", str(tmp_path / "out"), *options]) == 0
        assert ("runs on the server at http://127.0.0.1" in capsys.readouterr().out) == drives
