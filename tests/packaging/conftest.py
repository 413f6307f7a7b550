"""The built wheel, installed in an environment with the packages that ``make run`` installs."""

from __future__ import annotations

import re
import subprocess
import sys
import venv
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

from tests.commands import output

ROOT = Path(__file__).resolve().parents[2]
BROKEN = "raise SystemExit('a file of the user was run')\n"
LOCKED = re.compile(r"^([a-z0-9][a-z0-9._-]*)==([^ ;\\]+)", re.MULTILINE)


def build(target: str, source: Path, out: Path) -> Path:
    """Build the ``target`` ``wheel`` or ``sdist`` of the folder ``source`` in ``out``."""
    output(
        [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(out)],
        cwd=source,
        seconds=120,
    )
    (built,) = out.glob("*.whl" if target == "wheel" else "*.tar.gz")
    return built


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the interpreter of a fresh environment with the wheel in it.

    Its dependencies are only the packages of requirements.lock, as links to those of the
    environment that runs the tests.
    """
    home = tmp_path_factory.mktemp("fresh")
    venv.create(home, with_pip=False)
    python = home / "bin" / "python"
    subprocess.run(
        [
            *(sys.executable, "-m", "uv", "pip", "install", "--quiet", "--offline", "--no-deps"),
            *("--python", str(python), str(wheel)),
        ],
        check=True,
        timeout=120,
    )
    (site,) = home.glob("lib/python*/site-packages")
    link_locked_packages(site)
    # Another distribution that ships a package of this name.
    (site / "app").mkdir()
    (site / "app" / "__init__.py").write_text(BROKEN, encoding="utf-8")
    return python


def link_locked_packages(site: Path) -> None:
    """Link every package of requirements.lock that this machine needs into the folder ``site``."""
    lock = LOCKED.findall((ROOT / "requirements.lock").read_text(encoding="utf-8"))
    versions: dict[str, set[str]] = {}
    for name, version in lock:
        versions.setdefault(name, set()).add(version)
    for name, locked in versions.items():
        try:
            installed = distribution(name)
        except PackageNotFoundError:
            # The package is for another system or version of Python.
            continue
        assert installed.version in locked, (
            f"{name} {installed.version} is not the one that is locked"
        )
        for top in {file.parts[0] for file in installed.files or ()} - {"..", "__pycache__"}:
            link = site / top
            if not link.exists():
                link.symlink_to(Path(str(installed.locate_file(top))))
