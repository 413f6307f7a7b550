"""A public class name stands for one class, or the glossary gives the reason."""

from __future__ import annotations

import ast
import re
from collections import Counter
from functools import cache
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "app" / "katana450"
GLOSSARY = ROOT / "docs" / "glossary.md"
SECTION = "## One name, several classes"
CLASS = re.compile(r"^class ([A-Za-z]\w*)", re.MULTILINE)


def role(node: ast.ClassDef) -> str:
    """Return whether the class is a command, a request or a program step; empty for others."""
    bases = {ast.unparse(base) for base in node.bases}
    if bases & {"Command", "AxisCommand"}:
        return "command"
    if any(base.endswith("Request") for base in bases):
        return "request"
    return "step" if bases & {"Step", "_Turn"} else ""


@cache
def defined_twice(package: Path) -> set[str]:
    """Return the names of public classes with several definitions at the top of modules.

    A command, its request and its program step share a name. Most files are not parsed, as each
    of their names is in one file only.
    """
    texts = [file.read_text(encoding="utf-8") for file in sorted(package.rglob("*.py"))]
    names = [CLASS.findall(text) for text in texts]
    often = {name for name, times in Counter(chain(*names)).items() if times > 1}
    roles: dict[str, list[str]] = {}
    for text in (text for text, classes in zip(texts, names, strict=True) if often & {*classes}):
        for node in ast.parse(text).body:
            if isinstance(node, ast.ClassDef) and node.name in often:
                roles.setdefault(node.name, []).append(role(node))
    return {
        name
        for name, uses in roles.items()
        if len(uses) > 1 and not (all(uses) and len(set(uses)) == len(uses))
    }


def with_a_reason(glossary: str) -> set[str]:
    """Return the names that the section of ``glossary`` lists with a reason."""
    _, heading, rest = glossary.partition(f"\n{SECTION}\n")
    assert heading, f"{GLOSSARY} has no section {SECTION!r}"
    section = re.split(r"^## ", rest, maxsplit=1, flags=re.MULTILINE)[0]
    return set(re.findall(r"^- `(\w+)`: \S", section, flags=re.MULTILINE))


def listed() -> set[str]:
    return with_a_reason(GLOSSARY.read_text(encoding="utf-8"))


def test_class_defined_twice_has_a_reason_in_the_glossary() -> None:
    unexplained = defined_twice(PACKAGE) - listed()
    assert not unexplained, "choose another name, or give the reason in docs/glossary.md"


def test_glossary_lists_no_name_with_one_class() -> None:
    assert not listed() - defined_twice(PACKAGE), "take these names out of docs/glossary.md"
