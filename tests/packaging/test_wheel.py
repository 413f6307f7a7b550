"""The built wheel works in a virtual environment, beside files of a user with colliding names."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from tests.browser.server import AppServer
from tests.commands import output
from tests.packaging.conftest import BROKEN

LINE = '{"q": [0, 0, 0, 0, 0]}\n'


@pytest.fixture(params=["app.py", pytest.param("app/__init__.py", marks=pytest.mark.long)])
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return the folder of a user who works there and has files with our old names."""
    for name in (request.param, "static/__init__.py", "robot_description/__init__.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(BROKEN, encoding="utf-8")
    return tmp_path


def run(folder: Path, *command: str | Path, text: str = "") -> str:
    return output([str(part) for part in command], cwd=folder, text=text, env={"PYTHONPATH": "."})


def test_wheel_holds_one_package_with_its_data(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"katana450"}
    robots = ("katana450.urdf", "so101/so101.urdf", "so101/meshes/base_link.glb")
    for wanted in ("py.typed", "static/page.js", *(f"robot_description/{name}" for name in robots)):
        assert f"katana450/{wanted}" in names
    for unwanted in ("/cad/", "__pycache__"):
        assert not [name for name in names if unwanted in name]


def test_library_is_used_beside_files_of_the_user(python: Path, folder: Path) -> None:
    words = (
        "import katana450; print(katana450.__file__); arm = katana450.load(); "
        "print(arm.fk([0, 0, 0, 0, 0])[0].tolist()); "
        "print(arm.circle((0.15, 0.0, -0.11), 0.1).end.shape)"
    )
    imported, first, second = run(folder, python, "-c", words).splitlines()
    assert Path(imported).is_relative_to(python.parents[1])
    assert first.startswith("[1.0, 0.0, 0.0, 0.63")
    assert second == "(5,)"


def test_commands_run_beside_files_of_the_user(python: Path, folder: Path) -> None:
    for command in ([python.parent / "katana450"], [python, "-m", "katana450"]):
        assert '"T": [[1.0, ' in run(folder, *command, "fk", text=LINE)


@pytest.mark.long
def test_server_runs_beside_files_of_the_user(
    python: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", ".")
    command = [str(python), "-m", "katana450", "serve", "--port", "{port}"]
    with AppServer(command, folder=folder) as server:
        assert server.running


@pytest.mark.long
def test_demo_runs_beside_files_of_the_user(python: Path, folder: Path) -> None:
    output = run(folder, python.parent / "katana450", "demo", "circle", "--headless")
    assert "circle" in output.lower()
