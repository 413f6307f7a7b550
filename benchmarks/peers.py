"""A separate environment for each peer of a benchmark, so that requirements cannot conflict."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PINS = Path(__file__).with_name("peers.lock")
PEERS = ("EAIK", "ik-geo", "pytracik", "roboticstoolbox-python", "pin", "mink", "ikpy")
_LINES_OF_REASON = 3


def prepare(folder: Path, peer: str) -> Path | str:
    """Return the Python of an environment with `peer`; else the reason why there is none.

    The environment is installed under `folder` if it is missing.
    """
    home = folder / peer
    python = home / "bin" / "python"
    uv = [sys.executable, "-m", "uv"]
    commands = [
        [
            *(*uv, "pip", "install", "--quiet", "--python", str(python)),
            # Some peers leave numpy, which the benchmarks need, to their users.
            *("--constraint", str(PINS), peer, "numpy"),
        ]
    ]
    if not python.exists():
        commands.insert(0, [*uv, "venv", "--quiet", "--python", sys.executable, str(home)])
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            output = done.stderr.strip().splitlines()[-_LINES_OF_REASON:]
            return " ".join(" ".join(output).split()) or f"exit status {done.returncode}"
    return python


def refresh_pins() -> None:
    """Resolve the newest versions of all peers into the lock file."""
    subprocess.run(
        [
            *(sys.executable, "-m", "uv", "pip", "compile", "--upgrade", "--universal", "--quiet"),
            *("--no-header", "--no-annotate", "--python-version", "3.11"),
            *("--output-file", str(PINS), "-"),
        ],
        input="\n".join(PEERS),
        text=True,
        check=True,
    )


if __name__ == "__main__":
    refresh_pins()
