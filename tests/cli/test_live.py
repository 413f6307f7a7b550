"""``katana450 run`` and ``demo`` start a server if none is running."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.browser.server import free_port
from tests.commands import completed

KATANA450 = str(Path(sys.executable).parent / "katana450")
SCRIPT = "steps:\n  - gripper: open\n"


def run(folder: Path, url: str) -> subprocess.CompletedProcess[str]:
    script = folder / "script.yaml"
    script.write_text(SCRIPT, encoding="utf-8")
    return completed([KATANA450, "run", script.name, "--url", url], cwd=folder, seconds=90)


@pytest.mark.long
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
