"""``import katana450``: its public names, and the libraries that it does not load."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import katana450
from tests.commands import modules_after

HEAVY = ("numpy", "viser", "mujoco", "trimesh", "yourdfpy", "matplotlib", "ruckig", "msgspec")


SERVERS = {"starlette", "uvicorn", "websockets", "viser"}

LIGHT = {
    "import katana450": {*HEAVY},
    "import katana450; dir(katana450); katana450.InputError": {*HEAVY},
    "import katana450; katana450.load().fk([0.0] * 5)": {*SERVERS, "matplotlib"},
    "import katana450.cli.serve": {*SERVERS, "numpy"},
    "import katana450.assembly.stop_process": {*SERVERS, "numpy"},
    "import katana450.assembly.web_server": {"numpy", "viser", "trimesh"},
    "from katana450.cli.main import _parser; _parser()": {
        *("numpy", "viser", "yaml", "trimesh", "asyncio", "importlib.metadata")
    },
}
"""Statements, and the modules that they do not load."""


@pytest.mark.parametrize("statement", LIGHT)
def test_statement_loads_nothing_heavy(statement: str) -> None:
    loaded = modules_after(statement)
    assert "katana450" in loaded
    if statement == "import katana450":
        assert {name for name in loaded if name.startswith("katana450.")} == {
            "katana450.lazy_names"
        }
    assert not loaded & LIGHT[statement]


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
