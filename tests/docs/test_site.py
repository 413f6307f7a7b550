"""The documentation site builds without a warning and loads nothing from other servers."""

from __future__ import annotations

import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

import katana450
from tests.docs.code_blocks import DOCUMENTS, FENCE, ROOT

ITEM = re.compile(r"(?:[-*]|\d+\.) ")
LOADED = re.compile(r'<(?:script|img|iframe|link)\b[^>]*?(?:src|href)="(https?:[^"]+)"')


@pytest.fixture(scope="module")
def site() -> Path:
    done = subprocess.run(
        [sys.executable, "-m", "docs.site.build"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stdout + done.stderr
    return ROOT / "build" / "site"


def test_every_page_loads_its_parts_from_the_site(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 60
    for page in pages:
        assert not LOADED.findall(page.read_text(encoding="utf-8")), page


def test_reference_documents_every_public_name(site: Path) -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in site.glob("reference/*.html"))
    for name in katana450.__all__:
        assert f'id="katana450.{name}"' in text, name


def test_examples_of_docstrings_are_shown_as_code(site: Path) -> None:
    text = (site / "reference" / "arms.html").read_text(encoding="utf-8")
    assert '<span class="gp">&gt;&gt;&gt; ' in text
    assert "<blockquote>" not in text


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_list_begins_after_an_empty_line(document: Path) -> None:
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    lines = ["", *text.splitlines()]
    for before, line in pairwise(lines):
        if ITEM.match(line) and before and not before.startswith(" "):
            assert ITEM.match(before) or before.startswith("#"), (
                f"the site runs this item into the paragraph above it: {line}"
            )
