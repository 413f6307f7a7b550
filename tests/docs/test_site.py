"""The documentation site builds without a warning and loads nothing from other servers."""

from __future__ import annotations

import re
import sys
from itertools import pairwise
from pathlib import Path

import pytest

import katana450
from tests.commands import completed
from tests.docs.code_blocks import DOCUMENTS, FENCE, ROOT

ITEM = re.compile(r"(?:[-*]|\d+\.) ")
MAX_LINES = 6000
"""Maximum number of lines of docs/*.md together, so that they can be read."""
LOADED = re.compile(r'<(?:script|img|iframe|link)\b[^>]*?(?:src|href)="(https?:[^"]+)"')


@pytest.fixture(scope="module")
def site() -> Path:
    done = completed([sys.executable, "-m", "docs.site.build"], seconds=240)
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


def test_pages_stay_short_enough_to_be_read() -> None:
    pages = {path.name: path.read_bytes().count(b"\n") for path in ROOT.glob("docs/*.md")}
    assert sum(pages.values()) <= MAX_LINES, pages


def test_archive_lists_every_decision_by_its_title() -> None:
    folder = ROOT / "docs" / "decisions"
    rows = re.findall(
        r"^\| \[(.+?)\]\((.+?)\) \| ", (folder / "archive.md").read_text("utf-8"), re.MULTILINE
    )
    files = sorted(folder.glob("0*.md"))
    headings = [path.read_text("utf-8").partition("\n")[0].removeprefix("# ") for path in files]
    names = [path.name for path in files]
    assert rows == list(zip(headings, names, strict=True)), (
        "add its row to docs/decisions/archive.md"
    )


def test_twelve_decisions_are_for_newcomers() -> None:
    text = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    assert len(set(re.findall(r"\((0\d{3}-.+?\.md)\)", text))) == 12
