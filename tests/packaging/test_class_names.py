"""A public class name stands for one class, or the glossary gives the reason."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

from katana450.server.api import requests

ROOT = Path(__file__).resolve().parents[2]
CLASS = re.compile(r"^class ([A-Za-z]\w*)", re.MULTILINE)
STEP = re.compile(r"^class (\w+)\(.*\bword=", re.MULTILINE)
ENTRY = re.compile(r"^- ((?:`\w+`(?:, )?)+): \S", re.MULTILINE)


def test_class_names_that_are_defined_twice_are_those_with_a_reason_in_the_glossary() -> None:
    files = (ROOT / "app" / "katana450").rglob("*.py")
    texts = [file.read_text("utf-8") for file in files]
    times = Counter(name for text in texts for name in CLASS.findall(text))
    # An act and the step of the same verb count once.
    steps = {name for text in texts for name in STEP.findall(text)}
    times.subtract(steps & {kind.__name__ for kind in requests.EVERY})
    glossary = (ROOT / "docs" / "glossary.md").read_text("utf-8")
    section = glossary.partition("\n## One name, several classes\n")[2].partition("\n## ")[0]
    listed = {name for entry in ENTRY.findall(section) for name in re.findall(r"\w+", entry)}
    assert {name for name, count in times.items() if count > 1} == listed
