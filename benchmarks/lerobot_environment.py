"""The environment in which LeRobot reads our datasets, and runs with our plug-ins."""

from __future__ import annotations

import os
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
"""File in the environment that has the pins that are installed, once it is complete."""

ROOT = Path(__file__).resolve().parents[1]
PLUGINS = ("lerobot_robot_katana450", "lerobot_teleoperator_katana450")

LINES_OF_REASON = 3


def prepare_lerobot(home: Path) -> Path | str:
    """Return the Python of the environment at ``home``; else the reason why there is none.

    It is installed if it is missing, which takes 1.3 GB.
    """
    python, ready = home / "bin" / "python", home / READY
    if ready.is_file() and ready.read_bytes() == PINS.read_bytes():
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
    plugins = [word for name in PLUGINS for word in ("--editable", str(ROOT / "plugins" / name))]
    why = why or _failure([*install, *others])
    why = why or _failure([*install, "--no-build-isolation", *plugins])
    if why:
        return why
    ready.write_bytes(PINS.read_bytes())
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
        "PYTHONPATH": os.pathsep.join(map(str, (sources, sources / "app"))),
    }
