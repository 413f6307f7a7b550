"""The environment in which LeRobot's own loader reads our datasets."""

from __future__ import annotations

import subprocess
import sys
import venv
from pathlib import Path

PINS = Path(__file__).with_name("lerobot.lock")
TORCH = "torch"
CPU_SUFFIX = "+cpu"
"""Torch's own index has a build for processors only under this local version."""

CPU_INDEX = "https://download.pytorch.org/whl/cpu"
READY = ".ready"
"""File in the environment that says that it is complete."""

LINES_OF_REASON = 3


def prepare_lerobot(home: Path) -> Path | str:
    """Return the Python of the environment at ``home``; else the reason why there is none.

    It is installed if it is missing, which takes 1.3 GB.
    """
    python = home / "bin" / "python"
    if (home / READY).is_file():
        return python
    venv.create(home, with_pip=True, clear=True)
    pins = [line for line in PINS.read_text(encoding="utf-8").split("\n") if "==" in line]
    (torch,) = (pin for pin in pins if pin.startswith(f"{TORCH}=="))
    others = [pin for pin in pins if pin != torch]
    install = [str(python), "-m", "pip", "install", "--quiet", "--no-deps"]
    # An index of the user may have the build too.
    why = ""
    for options in ([], ["--index-url", CPU_INDEX]):
        why = _failure([*install, *options, f"{torch}{CPU_SUFFIX}"])
        if not why:
            break
    why = why or _failure([*install, *others])
    if why:
        return why
    (home / READY).touch()
    return python


def _failure(command: list[str]) -> str:
    """Run ``command``; return why it failed, or nothing."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return ""
    output = done.stderr.strip().splitlines()[-LINES_OF_REASON:]
    return " ".join(" ".join(output).split()) or f"exit status {done.returncode}"


def environment_of(sources: Path, home: Path) -> dict[str, str]:
    """Return variables of a process in the environment at ``home``, which asks no server."""
    return {
        "HF_HUB_OFFLINE": "1",
        "HF_HOME": str(home / "cache"),
        "PATH": str(Path(sys.executable).parent),
        "PYTHONPATH": str(sources),
    }
