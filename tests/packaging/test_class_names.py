"""A public class name stands for one class, or the glossary gives the reason."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CLASS = re.compile(r"^class ([A-Za-z]\w*)", re.MULTILINE)
ENTRY = re.compile(r"^- ((?:`\w+`(?:, )?)+): \S", re.MULTILINE)


def test_class_names_that_are_defined_twice_are_those_with_a_reason_in_the_glossary() -> None:
    files = (ROOT / "app" / "katana450").rglob("*.py")
    times = Counter(name for file in files for name in CLASS.findall(file.read_text("utf-8")))
    glossary = (ROOT / "docs" / "glossary.md").read_text("utf-8")
    section = glossary.partition("\n## One name, several classes\n")[2].partition("\n## ")[0]
    listed = {name for entry in ENTRY.findall(section) for name in re.findall(r"\w+", entry)}
    assert {name for name, count in times.items() if count > 1} == listed
