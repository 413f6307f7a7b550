"""``import katana450``: its public names, and the libraries that it does not load."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import katana450

HEAVY = ("numpy", "viser", "mujoco", "trimesh", "yourdfpy", "matplotlib", "ruckig", "msgspec")


def modules_after(statement: str) -> set[str]:
    """Return the names of all modules that a fresh process has loaded after ``statement``."""
    done = subprocess.run(
        [sys.executable, "-c", f"{statement}; import sys; print(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return set(done.stdout.split())


def test_import_loads_no_library() -> None:
    loaded = modules_after("import katana450")
    assert "katana450" in loaded
    assert not loaded.intersection(HEAVY)
    assert {name for name in loaded if name.startswith("katana450.")} == {"katana450.lazy_names"}


def test_errors_and_names_load_no_library() -> None:
    loaded = modules_after("import katana450; dir(katana450); katana450.InputError")
    assert not loaded.intersection(HEAVY)


def test_kinematics_load_neither_viewer_nor_plots() -> None:
    loaded = modules_after("import katana450; katana450.load().fk([0.0] * 5)")
    assert "numpy" in loaded
    assert not loaded.intersection({"viser", "matplotlib", "starlette", "websockets"})


@pytest.mark.parametrize("name", ["cli.serve", "assembly.stop_process"])
def test_supervisor_and_process_of_stop_start_light(name: str) -> None:
    loaded = modules_after(f"import katana450.{name}")
    assert not loaded.intersection({"numpy", "viser", "starlette", "uvicorn"})


@pytest.mark.parametrize("name", katana450.__all__)
def test_every_public_name_has_a_docstring(name: str) -> None:
    assert getattr(katana450, name).__doc__
    assert name in dir(katana450)


def test_names_for_editors_are_those_at_run_time() -> None:
    tree = ast.parse(Path(katana450.__file__).read_text(encoding="utf-8"))
    typed = {
        alias.name: f"{node.module}"
        for block in tree.body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(typed) == katana450.__all__
    assert typed == katana450._MODULES


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = katana450.nonsense  # type: ignore[attr-defined]
    with pytest.raises(ImportError):
        exec("from katana450 import nonsense")
