"""The packages that ``make run`` installs are enough for what the README shows."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pip
import pytest
import trimesh

from katana450.extras import PACKAGES
from tests.commands import completed
from tests.exchange.compressed_gltf import draco_glb
from tests.exchange.test_threemf import threemf

ROOT = Path(__file__).resolve().parents[2]
LOADED_ON_USE = ("git", "imageio_ffmpeg", "matplotlib", "xacro")
EXTRAS = ("DracoPy", "embreex", "imageio_ffmpeg", "networkx", "pyarrow", "serial")
NOT_LOCKED = (*EXTRAS, "hypothesis", "mypy", "playwright", "pytest", "scipy")
MAX_SIZE = 330
"""[MiB] What `make run` may put into `.venv` on Linux."""

VRML = """#VRML V2.0 utf8
Shape { geometry IndexedFaceSet {
  coord Coordinate { point [0 0 0, 30 0 0, 0 30 0, 0 0 30] }
  coordIndex [0 2 1 -1 0 1 3 -1 0 3 2 -1 1 2 3 -1] } }
"""
READ = """
from pathlib import Path
from katana450.errors import KatanaError
from katana450.extensions.importers.formats.mesh_file import read_mesh
for path in sorted(Path().iterdir()):
    try:
        print(path.name, len(read_mesh(path.read_bytes(), path.name, "mm").faces))
    except KatanaError as error:
        print(path.name, str(error)[-23:])
"""
DRAWN = """
import sys
from pathlib import Path
from katana450.arm.robot.loader import load
from katana450.extensions.export.glb import glb_files
robot = load(Path(sys.argv[1]))
print(all(glb_files(robot, robot.values(())).values()))
"""
ROBOT = """<robot name="parts"><link name="base">
  <visual><geometry><mesh filename="part.dae"/></geometry></visual>
  <visual><geometry><mesh filename="part.stl"/></geometry></visual>
  <visual><geometry><cylinder radius="0.1" length="0.2"/></geometry></visual></link></robot>"""


def run(folder: Path, *command: str | Path, seconds: float = 120.0, status: int = 0) -> str:
    """Return the output of ``command``, started in ``folder``; the errors if it has a status."""
    words = [str(part) for part in command]
    done = completed(words, cwd=folder, seconds=seconds)
    assert done.returncode == status, done.stderr
    return done.stderr if status else done.stdout


def test_libraries_of_extras_and_tests_are_not_installed(python: Path, tmp_path: Path) -> None:
    words = (
        "import matplotlib.pyplot, PIL.Image; "
        f"from importlib.util import find_spec; print(*filter(find_spec, {NOT_LOCKED}))"
    )
    assert run(tmp_path, python, "-c", words).split() == []


@pytest.mark.skipif(sys.platform != "linux", reason="wheels of other systems have other sizes")
def test_first_installation_is_small(python: Path, tmp_path: Path) -> None:
    # The fixture has links to the packages, and each file counts once.
    (site,) = python.parents[1].glob("lib/python*/site-packages")
    folders = [site, Path(pip.__file__).parent]
    options = ("--summarize", "--total", "-mL", "--exclude=katana450")
    used = run(tmp_path, "du", *options, *folders).splitlines()
    assert int(used[-1].split()[0]) <= MAX_SIZE


def test_libraries_are_loaded_on_use_only(python: Path, tmp_path: Path) -> None:
    words = (
        "import sys; from katana450.cli.main import _parser; _parser(); "
        "from katana450.cli import serve; import katana450.assembly.frontend_process; "
        f"import katana450; katana450.load(); print(*filter(sys.modules.get, {LOADED_ON_USE}))"
    )
    assert run(tmp_path, python, "-c", words).split() == []


@pytest.mark.long
def test_shapes_are_read_without_extras(python: Path, tmp_path: Path) -> None:
    box = trimesh.creation.box((10.0, 20.0, 30.0))
    for kind in ("stl", "obj", "ply", "glb"):
        box.export(tmp_path / f"box.{kind}")
    (tmp_path / "draco.glb").write_bytes(draco_glb())
    (tmp_path / "l.3mf").write_bytes(threemf())
    (tmp_path / "v.wrl").write_text(VRML, encoding="utf-8")
    modules = dict(line.split(" ", 1) for line in run(tmp_path, python, "-c", READ).splitlines())
    assert modules.pop("draco.glb").endswith("dracopy networkx")
    assert modules.pop("l.3mf").endswith("dracopy networkx")
    assert len(modules) == 5
    assert all(int(faces) >= 2 for faces in modules.values()), modules


def test_robots_of_other_files_are_drawn_without_extras(python: Path, tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "part.dae")
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.vertices *= np.array((1.0, 2.0, 3.0))
    ball.export(tmp_path / "part.stl")
    (tmp_path / "arm.urdf").write_text(ROBOT, encoding="utf-8")
    assert run(tmp_path, python, "-c", DRAWN, "arm.urdf").split() == ["True"]


def test_documents_list_the_extras_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    page = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `(\w+)` \| ([\w, -]+) \|", page, re.MULTILINE)
    names = {
        extra: " ".join(re.split(r"[^\w-]", package)[0] for package in packages)
        for extra, packages in project["optional-dependencies"].items()
    }
    assert {extra: packages.replace(",", "") for extra, packages in listed} == names == PACKAGES
