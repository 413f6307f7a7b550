"""Find the programs that read our exports, and Firefox; install them if nobody must confirm.

``python tests/exchange/tools.py`` installs them. Tests of a missing program are skipped.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest

PACKAGES = {
    "gcc": "gcc",
    "g++": "g++",
    "make": "make",
    "clang": "clang",
    "cmake": "cmake",
    "/usr/include/GL/freeglut.h": "freeglut3-dev",
    "/usr/share/doc/libgl1-mesa-dri": "libgl1-mesa-dri",
    "xvfb-run": "xvfb",
    "xauth": "xauth",
    "xdotool": "xdotool",
    "tovrmlx3d": "view3dscene",
    "view3dscene": "view3dscene",
    "firefox-esr": "firefox-esr",
}
"""Programs and files, and the Debian packages that provide them."""

X_ITE = "x_ite@15.0.1"
"""A browser of VRML and X3D worlds in JavaScript, from npm."""

X_ITE_FOLDER = Path(__file__).parents[2] / ".cache" / X_ITE

PYBULLET = "pybullet==3.2.7"
"""A simulator of robots, from PyPI; its wheel of 103 MB is too large for the other tests."""

PYBULLET_FOLDER = Path(__file__).parents[2] / ".cache" / PYBULLET

VTK = "vtk==9.7.2"
"""A library that reads VRML worlds, from PyPI; not among the project's dependencies."""

VTK_FOLDER = Path(__file__).parents[2] / ".cache" / VTK

SCREEN = ("xvfb-run", "--auto-servernum", "--server-args=-screen 0 1280x1024x24")

VIEWER = ("gcc", "make", "/usr/include/GL/freeglut.h", "xvfb-run", "xauth")
"""Programs and files that are needed to build and run the C viewer."""


def missing(names: Sequence[str]) -> list[str]:
    """Return the Debian packages of the missing programs."""
    absent = [n for n in names if not (Path(n).exists() if n[0] == "/" else shutil.which(n))]
    return list(dict.fromkeys(PACKAGES[name] for name in absent))


def x_ite() -> Path | None:
    """Return the path of its script, if present."""
    script = X_ITE_FOLDER / "package" / "dist" / "x_ite.min.js"
    return script if script.is_file() else None


def vtk_folder() -> Path | None:
    """Return the folder of its modules, if present."""
    return VTK_FOLDER if (VTK_FOLDER / "vtkmodules").is_dir() else None


def needs(*names: str) -> pytest.MarkDecorator:
    """Return a mark that skips a test with the reason if one of the programs is missing."""
    packages = " ".join(missing(names))
    return pytest.mark.skipif(
        bool(packages), reason=f"not here; on Debian and Ubuntu: apt-get install {packages}"
    )


def pybullet() -> Path | None:
    """Return the folder to import it from, if present."""
    return PYBULLET_FOLDER if any(PYBULLET_FOLDER.glob("pybullet*.so")) else None


needs_pybullet = pytest.mark.skipif(
    pybullet() is None, reason=f"{PYBULLET} is not here; `make exchange` brings it"
)


def run(*words: str | Path, folder: Path | None = None, seconds: float = 60.0) -> str:
    """Run a program that must succeed within a time [s]; return its output."""
    # A process group, so that children of xvfb-run end with it.
    process = subprocess.Popen(
        [str(word) for word in words],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        printed, errors = process.communicate(timeout=seconds)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert process.returncode == 0, f"{words[0]} ended with {process.returncode}:\n{errors[-4000:]}"
    return printed


def fetch_x_ite() -> None:
    """Download and unpack it; nothing of it is executed."""
    X_ITE_FOLDER.mkdir(parents=True, exist_ok=True)
    pack = ["npm", "pack", X_ITE, "--silent"]
    print("Running:", *pack, flush=True)
    with suppress(subprocess.TimeoutExpired):
        subprocess.run(pack, cwd=X_ITE_FOLDER, check=False, timeout=120.0, capture_output=True)
    for archive in X_ITE_FOLDER.glob("*.tgz"):
        with tarfile.open(archive) as packed:
            packed.extractall(X_ITE_FOLDER, filter="data")
        archive.unlink()


def fetch(package: str, folder: Path) -> str:
    """Unpack the wheel of ``package`` into ``folder``; return why that was not possible."""
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install"]
    place = ["--no-deps", "--only-binary=:all:", "--target", str(folder), package]
    print("Running:", *pip, *place, flush=True)
    try:
        done = subprocess.run(
            [*pip, *place], check=False, timeout=300.0, capture_output=True, text=True
        )
    except subprocess.TimeoutExpired:
        return "it took more than 300 s"
    return done.stderr.strip().rpartition("\n")[2]


def main() -> None:
    """Print the programs that the tests use; install missing ones first if root can."""
    packages = missing(list(PACKAGES))
    if packages and shutil.which("apt-get") and os.geteuid() == 0:
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        install = ["apt-get", "install", "--yes", "--quiet=2", "--no-install-recommends", *packages]
        for command in (["apt-get", "update", "--quiet=2"], install):
            print("Running:", *command, flush=True)
            with suppress(subprocess.TimeoutExpired):
                subprocess.run(
                    command, env=environment, stdout=subprocess.DEVNULL, check=False, timeout=600.0
                )
    if x_ite() is None and shutil.which("npm"):
        fetch_x_ite()
    print("X_ITE for the tests:", x_ite() or f"not here; npm brings {X_ITE}")
    why = "" if pybullet() else fetch(PYBULLET, PYBULLET_FOLDER)
    print("PyBullet for the tests:", pybullet() or f"not here; {why}")
    why = "" if vtk_folder() else fetch(VTK, VTK_FOLDER)
    print("VTK for the tests:", vtk_folder() or f"not here; {why}")
    packages = missing(list(PACKAGES))
    print(
        f"Some tests are skipped; on Debian and Ubuntu: apt-get install {' '.join(packages)}"
        if packages
        else "The programs that read our exports, and Firefox, are all here."
    )


if __name__ == "__main__":
    main()
