"""Catalogues of the page: each has all texts, with the same values, and none that is not shown."""

from __future__ import annotations

import json
import re
from itertools import product

import pytest

from katana450.arm.control.state import messages
from katana450.arm.control.state.state import Finding, Reason
from katana450.resources import STATIC
from katana450.server.web.static_files import contents

FILES = sorted((STATIC / "language").glob("*.json"))
CATALOGUES = {path.stem: json.loads(path.read_text("utf-8")) for path in FILES}
GERMAN = CATALOGUES["de"]
VALUE = re.compile(r"\{\d\}")
LETTERS = re.compile(r"[^\W\d_]{2}")
ATTRIBUTE = re.compile(r'(?:title|aria-label|placeholder|alt|data-drop)="([^"]+)"')
KEPT = re.compile(r"<(?:kbd|option [^>]*lang)[^>]*>[^<]*")
STRING = re.compile(r'"((?:[^"\\\n]|\\.)*)"|`((?:[^`\\]|\\.)*)`')
WORDS = re.compile(r"[A-Z][a-z]+…?$|.*[^\W\d_]{2,}[,.;:?!…]? ([^\W\d_{(]|$)|.*\{\} [^\W\d_]{2}")
"""Pattern of a string for people: one word with a capital, or several words."""

CODE = re.compile(
    r"""[#.:\[(@<]\w|\n|[ ]{2}|.*(?:\{[a-z]|\w\(|px\b|/\{\}|\[\w+=|\\n|\$\{|style\b|label\[)
    |input,|The\ page\ has\ no|viser's|Running\ text|bar\ views|matrix|position:|\w+:\ (?:\[|\{\}$)
    |kbd,|textarea,|html\[""",
    re.VERBOSE,
)
"""Pattern of strings that look like words and are none, and of errors for developers."""

NOT_SHOWN = {"Delete", "Enter", "Escape", "Seen", "Mesh", "Start", "Update", "Del", "Files"} | {
    *("arm (drag)", "run again", "{} go", "{} kept", "{} file", "started by {}", "started by you"),
    *("Katana450", "REC", "SpaceMouse", "Pour", "Wave", "{} of {}"),
}
"""Names, and strings that are compared or sent."""

UNITS = ("mm", "cm", "in", "mm/s")
PATTERNS = [
    re.compile("(.+?)".join(map(re.escape, VALUE.split(key)))) for key in GERMAN if "{1}" in key
]


def texts_of_page() -> set[str]:
    """Return the texts of the document and the strings for people of its scripts."""
    document = KEPT.sub("<i>", (STATIC / "index.html").read_text("utf-8"))
    texts = set(re.findall(r">([^<>]+)<", document) + ATTRIBUTE.findall(document))
    for path, content in contents().items():
        if path.endswith(".js"):
            source = re.sub(r"\$\{[^{}`]*\}", "{}", content.decode())
            strings = {quoted or template for quoted, template in STRING.findall(source)}
            texts |= {text for text in strings if WORDS.match(text) and not CODE.match(text)}
    return {" ".join(text.split()) for text in texts} - NOT_SHOWN


def is_covered(text: str) -> bool:
    """Return whether the catalogue has a text, its pattern or its parts."""
    if not LETTERS.search(text) or text in UNITS:
        return True
    # A reason begins with a capital, and ends with a point, where it is a sentence.
    for words in (text, text[:1].lower() + text[1:], text.rstrip(".,:"), text.lstrip(", ")):
        matches = (pattern.fullmatch(words) for pattern in PATTERNS)
        if words in GERMAN or any(m and all(map(is_covered, m.groups())) for m in matches):
            return True
    parts = re.split(r"(?<=[.!?…]) |; |: ", text)
    return len(parts) > 1 and all(map(is_covered, parts))


def is_template_covered(text: str) -> bool:
    """Return whether the catalogue has a text whose values, ``{}``, are numbers or nothing."""
    literals = text.split("{}")
    choices = product(("1", ""), repeat=len(literals) - 1)
    return any(
        is_covered("".join(map("".join, zip(literals, (*values, ""), strict=True))).strip())
        for values in choices
    )


def test_catalogue_has_all_texts_of_the_page() -> None:
    assert [text for text in sorted(texts_of_page()) if not is_template_covered(text)] == []


def test_catalogue_has_all_reasons_and_states_of_the_arm() -> None:
    parts = ("base_link", "finger_left_link")
    texts = {
        messages.finding_text(Finding(reason, 0.1, 1, parts, time))
        for reason, time in product(Reason, (0.0, 0.5))
    }
    tables = (messages.STATUS, messages.UNDER_WAY, messages.PRIORITY_HINTS)
    texts |= {text for table in tables for text in table.values()}
    assert [text for text in sorted(texts) if not is_covered(text)] == []


@pytest.mark.parametrize("language", CATALOGUES)
def test_languages_have_the_same_texts_and_values(language: str) -> None:
    catalogue = CATALOGUES[language]
    # In one order, so that two new texts rarely meet in a merge.
    assert list(catalogue) == sorted(GERMAN)
    for key, text in catalogue.items():
        assert sorted(VALUE.findall(text)) == sorted(VALUE.findall(key)), key
        # What is translated is looked up again, so no translation may be another text in English.
        assert catalogue.get(text, text) == text, key


def test_catalogue_has_no_text_that_is_not_shown() -> None:
    package = STATIC.parent / "app" / "katana450"
    sources = [content.decode() for content in contents().values()]
    sources += [path.read_text("utf-8") for path in package.rglob("*.py")]
    source = re.sub(r'"\s*\n\s*f?"', "", "\n".join(sources))
    pieces = {piece for key in GERMAN for piece in VALUE.split(key) if LETTERS.search(piece)}
    assert [piece for piece in sorted(pieces) if piece.strip(" .:,") not in source] == []
