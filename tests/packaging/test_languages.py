"""Catalogues of the page: each has all texts, with the same values, and none that is not shown."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import katana450
from katana450.arm.control.state import messages
from katana450.extensions.programs.script.measures import MEASURES, title_of
from katana450.resources import STATIC
from katana450.server.web.static_files import contents

PACKAGE = Path(katana450.__file__).parent
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
    *("Katana450", "REC", "SpaceMouse", "Pour", "Wave", "{} of {}", "cm"),
}
"""Names, and strings that are compared or sent."""

MODULES = """
arm/control/lease.py arm/control/objects/*.py arm/control/session/*.py
arm/control/state/messages.py arm/control/state/scene_objects.py extensions/gallery/arms_command.py
extensions/importers/*.py extensions/importers/formats/[ms]*.py extensions/objects/*.py
extensions/programs/*/*.py extensions/recording/episodes/[kr]*.py extensions/recording/live/*.py
extensions/recording/playback/*.py extensions/recording/run_again.py extensions/robot_choice/*.py
extensions/undo.py maths/planning/*.py server/service/*.py server/view/controls.py
"""
"""Modules with sentences that a person of the page may see."""

FOR_PROGRAMS = (
    """
%s | %d | --programs | --arm | table of transitions | `T` is | `mesh` | its `shape` | mesh must
parts of | A five-axis arm | Only a five | A jog | The plan was | in_shoulder | he command has
`main` | `gripper` out | has the number | The state has | The ready posture | The curve of
The places of | The vias of | of a turn | Script of | }in the hand | handled above | Only `run`
nothing to {} | You runs | A plan needs | A blend must | A scaling | The tool's | Error in
The server itself | Path {} | `do` is | not execute it | icence | `t` and | a number of seconds
not stated | A scene of katana450 | } more | triangle{} | Interrupted | is not handled
A request about | The clock | line {}, column | run again. Times | recorded: {}
""".strip()
    .replace("\n", " | ")
    .split(" | ")
)
"""Parts of sentences that only users of the library, of the command line and of the log see."""

CLAUSES = (
    "{} deg {} % along it, at {}",
    "{} % along it, at {}",
    "be {} mm apart",
    "overlap by {} mm",
)
"""Values that functions return in words, and that the keys contain."""

COMPOSED = ("nothing to ", "pour into ", "stopped within ", " mm, and ", ", as given")
"""Parts of keys of which the code has the words apart."""


def template(text: str, clauses: tuple[str, ...] = ()) -> str:
    """Return a text with ``{}`` for its values and clauses, and for several side by side."""
    text = re.sub(r"(['`]?)\{\w*\}\1", "{}", text.replace("{parts}", "{} and {}"))
    for clause in clauses:
        text = text.replace(clause, "{}")
    return re.sub(r"\{\}(?: ?\{\})+", "{}", " ".join(text.split()))


TEMPLATES = {template(key, clauses) for key in GERMAN for clauses in ((), CLAUSES)}
ALL_TEMPLATES = "\n".join(TEMPLATES)


def texts_of_page() -> set[str]:
    """Return the texts of the document and the strings for people of its scripts."""
    document = KEPT.sub("<i>", (STATIC / "index.html").read_text("utf-8"))
    texts = set(re.findall(r">([^<>]+)<", document) + ATTRIBUTE.findall(document))
    for path, content in contents().items():
        if path.endswith(".js") and not path.startswith("uplot/"):
            source = re.sub(r"\$\{[^{}`]*\}", "{}", content.decode())
            strings = {quoted or template for quoted, template in STRING.findall(source)}
            texts |= {text for text in strings if WORDS.match(text) and not CODE.match(text)}
    return {" ".join(text.split()) for text in texts} - NOT_SHOWN


def sentences_of(path: Path) -> Iterator[str]:
    """Yield the strings that a module raises or returns, and its other sentences."""
    reasons, parts = set[ast.AST](), set[ast.AST]()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        text = ""
        match node:
            case ast.Raise() | ast.Return() | ast.Lambda():
                reasons.update(ast.walk(node))
            case ast.Expr(value=docstring):
                parts.add(docstring)
            case ast.JoinedStr(values=pieces):
                parts.update(pieces)
                values = (p.value if isinstance(p, ast.Constant) else "{}" for p in pieces)
                text = "".join(map(str, values))
            case ast.Constant(value=str(words)):
                text = words
        if node not in parts and (node in reasons or text.rstrip().endswith(".")):
            yield text


@cache
def shown_sentences() -> list[str]:
    """Return what a person may see of the strings of all modules."""
    paths = {path for place in MODULES.split() for path in PACKAGE.glob(place)}
    texts = {text for path in paths for text in sentences_of(path) if WORDS.match(text)}
    return [text for text in sorted(texts) if not any(part in text for part in FOR_PROGRAMS)]


def is_covered(text: str) -> bool:
    """Return whether the catalogue has a template, or all its parts."""
    text = text.strip(" ,.:[]")
    # A value that may be empty, and a reason, which begins with a capital where it is a sentence.
    words = {text, text.strip(" {};"), re.sub(r"\b\{\}", "", text), text[:1].lower() + text[1:]}
    if not LETTERS.search(text) or any(form in ALL_TEMPLATES for form in words):
        return True
    parts = re.split(r"(?<=[.!?…])(?= |\{)|; |: | (?=\[)", text)
    return len(parts) > 1 and all(map(is_covered, parts))


def test_catalogue_has_all_texts_of_the_page() -> None:
    tables = (messages.STATUS, messages.UNDER_WAY, messages.PRIORITY_HINTS)
    texts = texts_of_page().union(*(table.values() for table in tables))
    assert [text for text in sorted(texts) if not is_covered(template(text))] == []


def test_catalogue_has_all_sentences_of_the_server() -> None:
    shown = shown_sentences()
    assert len(shown) > 400
    assert [text for text in shown if not is_covered(template(text))] == []


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
    files = contents().items()
    sources = [content.decode() for path, content in files if not path.endswith(".json")]
    sources += [path.read_text("utf-8") for path in PACKAGE.rglob("*.py")]
    source = re.sub(r'"\s*\n\s*f?"', "", "\n".join(sources)).replace("{{", "{")
    for piece in {piece for key in GERMAN for piece in VALUE.split(key) if LETTERS.search(piece)}:
        words = piece.strip(" .:,'").split()
        half = max(2, (len(words) + 1) // 2)
        halves = (" ".join(words[:half]), " ".join(words[-half:]))
        # The code may compose a text of two.
        composed = any(part in piece for part in (*COMPOSED, *map(title_of, MEASURES)))
        assert composed or any(part in source for part in halves), piece


def test_short_patterns_match_no_sentence_without_its_own_entry() -> None:
    """A value of a short pattern may be any words, which then stay English in the middle."""
    patterns = {
        key: re.compile(r"((?:(?![.,:] ).)+?)".join(map(re.escape, VALUE.split(key))))
        for key in GERMAN
        if VALUE.search(key) and len(VALUE.sub("", key)) < 12
    }
    for text in shown_sentences():
        for sentence in re.split(r"(?<=[.!?…])(?= |\{)", template(text)):
            words = re.sub(r"\b\{\}", "", sentence).strip(" .")
            if len(words.split()) > 4 and words not in ALL_TEMPLATES:
                matches = [key for key, pattern in patterns.items() if pattern.fullmatch(words)]
                assert matches == [], words
