"""docs/viser.md lists all of viser's private parts that the code names, each with a test."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import viser

ROOT = Path(__file__).resolve().parents[2]
LIST = ROOT / "docs" / "viser.md"
BRIDGE = ROOT / "app" / "katana450" / "server" / "viser_bridge"
STATIC = ROOT / "static"
OURS = (STATIC / "viser.js", *sorted((STATIC / "viser").glob("*.js")))
SERVER_TESTS = "tests/viser_bridge/test_server_parts.py"
PAGE_TESTS = "tests/browser/test_viser_page.py"

PRIVATE_IN_SCRIPTS = re.compile(
    r"__viser\w+|mantine[\w-]*|\b[A-Z]\w+Message\b|message_batch|set_server|data-p\b"
)
"""Names of viser's page, as scripts and style sheets write them."""


class Part(NamedTuple):
    """A row of the list: its parts, the files that use them, and the tests of them."""

    names: tuple[str, ...]
    files: tuple[str, ...]
    tests: tuple[str, ...]


def listed(section: str = "") -> list[Part]:
    """Return the rows of the list, or those of the section that begins with ``section``."""
    entries = []
    for part in LIST.read_text(encoding="utf-8").split("\n## ")[1:]:
        if not part.startswith(section):
            continue
        for line in part.splitlines():
            cells = [re.findall(r"`([^`]+)`", cell) for cell in line.split("|")[1:-1]]
            if cells and cells[0]:
                tests = PAGE_TESTS if part.startswith("Page, as our scripts") else SERVER_TESTS
                named = cells[-1] if len(cells) == 5 else []
                full = tuple(test if "::" in test else f"{tests}::{test}" for test in named)
                entries.append(Part(tuple(cells[0]), tuple(cells[1]), full))
    return entries


def names() -> set[str]:
    return {name for row in listed() for name in row.names}


def trees(*folders: Path) -> Iterator[tuple[Path, ast.Module]]:
    """Parse the files below ``folders`` that mention viser."""
    for folder in folders:
        for path in sorted(folder.rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if "viser" in text:
                yield path, ast.parse(text)


def private_modules(tree: ast.Module) -> set[str]:
    """Return the private modules of viser that ``tree`` imports."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            modules = {module for module in inner if module.rpartition(".")[2].startswith("_")}
            names |= modules or {node.module}
    return {name for name in names if re.match(r"viser\.(_|infra\b)", name)}


def private_names(tree: ast.Module) -> set[str]:
    """Return the attributes with an underscore that ``tree`` uses of objects of others.

    Names that a module defines itself, or that viser does not have, are its own.
    """
    own = _defined(tree)
    names = set()
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(value=ast.Name(id="wire"), attr=name) if name != "Message":
                names.add(name)
            case ast.Attribute(value=ast.Name(id="self" | "cls")):
                pass
            case ast.Attribute(attr=name) if re.match("_[a-z]", name) and name not in own:
                names.add(name)
    return names & VISERS


def _defined(tree: ast.Module) -> set[str]:
    """Return the names of functions, and of attributes of ``self``, in ``tree``."""
    names = set()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                names.add(name)
            case ast.Attribute(value=ast.Name(id="self" | "cls"), attr=name):
                names.add(name)
    return names


def _of_viser() -> set[str]:
    """Return all words of viser's own modules."""
    assert viser.__file__ is not None
    text = "".join(path.read_text("utf-8") for path in Path(viser.__file__).parent.rglob("*.py"))
    return set(re.findall(r"\w+", text))


VISERS = _of_viser()


def test_only_the_bridge_names_private_parts_of_the_server() -> None:
    for path, tree in trees(ROOT / "app"):
        if path.is_relative_to(BRIDGE):
            continue
        modules = private_modules(tree)
        assert not modules, f"{path} imports {modules}: move that into {BRIDGE.name}"
        if imports_viser(tree):
            used = private_names(tree)
            assert not used, f"{path} uses {used} of viser: move that into {BRIDGE.name}"


def imports_viser(tree: ast.Module) -> bool:
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=aliases) if any(
                alias.name.startswith("viser") for alias in aliases
            ):
                return True
            case ast.ImportFrom(module=str(module)) if module.partition(".")[0] == "viser":
                return True
    return False


def test_private_parts_of_the_server_are_listed() -> None:
    for path, tree in trees(BRIDGE):
        for name in private_modules(tree) | private_names(tree):
            assert name in names(), f"{path} relies on viser's {name}: list it in {LIST.name}"


def test_only_these_scripts_name_private_parts_of_the_page() -> None:
    for path in sorted(STATIC.rglob("*")):
        if path.is_file() and path not in OURS:
            names = PRIVATE_IN_SCRIPTS.findall(path.read_text(encoding="utf-8"))
            assert not names, f"{path} names {names}: move that into {OURS[0].name}"


def test_exports_of_these_scripts_are_listed() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in OURS)
    exports = re.findall(r"^export (?:const|(?:async )?function) (\w+)", text, re.MULTILINE)
    rows = {name for row in listed("Page, as our scripts") for name in row.names}
    assert set(exports) == rows


def test_every_part_is_used_where_the_list_says() -> None:
    for row in listed():
        for name in row.files:
            places = [BRIDGE / name, STATIC / name, ROOT / name]
            assert any(place.exists() for place in places), f"{row.names}: there is no {name}"


def test_every_part_has_a_test_that_names_it() -> None:
    for section in ("Server", "Messages", "Page"):
        for row in listed(section):
            assert row.tests, f"{row.names} has no test"
            for test in row.tests:
                path, _, function = test.partition("::")
                source = (ROOT / path).read_text(encoding="utf-8")
                assert f"def {function}(" in source, f"{row.names}: there is no {test}"
    source = (ROOT / PAGE_TESTS).read_text(encoding="utf-8")
    for row in listed("Page, as our scripts"):
        for name in row.names:
            assert f'part("{name}")' in source, f"no test of {name} names it when it fails"


def test_version_is_exact_and_installed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"viser=={viser.__version__}" in project["dependencies"]
