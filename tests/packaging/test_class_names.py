"""A public class name stands for one class, or the glossary gives the reason."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "app" / "katana450"
GLOSSARY = ROOT / "docs" / "glossary.md"
SECTION = "## One name, several classes"


def defined_twice(package: Path) -> set[str]:
    """Return the names of public classes with several definitions at the top of modules."""
    count = Counter(
        node.name
        for file in sorted(package.rglob("*.py"))
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    return {name for name, definitions in count.items() if definitions > 1}


def with_a_reason(glossary: str) -> set[str]:
    """Return the names that the section of ``glossary`` lists with a reason."""
    _, found, rest = glossary.partition(f"\n{SECTION}\n")
    assert found, f"{GLOSSARY} has no section {SECTION!r}"
    section = re.split(r"^## ", rest, maxsplit=1, flags=re.MULTILINE)[0]
    return set(re.findall(r"^- `(\w+)`: \S", section, flags=re.MULTILINE))


def listed() -> set[str]:
    return with_a_reason(GLOSSARY.read_text(encoding="utf-8"))


def test_class_defined_twice_has_a_reason_in_the_glossary() -> None:
    unexplained = defined_twice(PACKAGE) - listed()
    assert not unexplained, "choose another name, or give the reason in docs/glossary.md"


def test_glossary_lists_no_name_with_one_class() -> None:
    assert not listed() - defined_twice(PACKAGE), "take these names out of docs/glossary.md"


def test_duplicate_is_found_across_modules(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "one.py").write_text("class A: ...\nclass B: ...\nclass _C: ...\n")
    (tmp_path / "inner" / "two.py").write_text("class A: ...\nclass _C: ...\n")
    assert defined_twice(tmp_path) == {"A"}


def test_reason_counts_only_in_its_section_and_with_words() -> None:
    before, after = "- `A`: before\n\n", "## Next\n\n- `D`: after\n"
    section = f"{SECTION}\n\n### Group\n\n- `B`: a reason.\n- `C`:\n\n"
    assert with_a_reason(before + section + after) == {"B"}
