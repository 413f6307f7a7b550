"""Check the language of code, documentation and messages against a list of words to avoid."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
CODE = ("app", "robot_description", "benchmarks", "examples", "plugins", "tests")
PROSE = ("docs", "examples")
PAGE = (".js", ".html", ".css")

OPENINGS = ("Of", "That", "Those", "Likewise", "What", "Who", "Whoever", "Whose", "How", "Whether")
"""Words that begin no docstring: the first word is a verb, or a noun that names the thing."""

WORDS = {
    "whoever|whomever|wherever": "name the subject: 'a client that ...', 'the person who ...'",
    "likewise": "'also', or repeat the verb",
    "sign of life|signs of life": "'heartbeat'",
    "patience": "'timeout'",
    "wish|wishes|wished": "'target' or 'request'",
    "is told|are told|was told|were told|be told|been told": "'is reported', 'is notified'",
    "gets told|being told": "'is reported', 'is notified'",
    "is said|are said": "'is reported', 'is stated'",
    "go on|goes on|going on|went on": "'continue'",
    "no good": "'invalid'",
    "all the same": "'nevertheless', or a sentence of its own",
    "nought|naught": "'zero' or 'nothing'",
    "none the less|none the worse": "say what happens instead",
    "once more|anew": "'again'",
    "front page": "'start page'",
}
"""Words to avoid, and what to write instead."""

OPENING = re.compile(rf'(?:\A|:\n) *[rR]?"""((?:{"|".join(OPENINGS)})[ ,.:\n].*)')
"""A docstring that begins so; ruff checks that each begins beside its quotes."""

BETWEEN_WORDS = re.compile(r"""(?:\\n|[\s"'#])+(?:f["'])?""")
"""Text between two words in source code: spaces, line ends, and quotes of its parts."""

PATTERN = re.compile("|".join(rf"(?P<w{i}>\b(?:{word})\b)" for i, word in enumerate(WORDS)), re.I)

ALL_WORDS = "|".join(WORDS).split("|")


def python_files() -> Iterator[Path]:
    for folder in CODE:
        yield from sorted((ROOT / folder).rglob("*.py"))


def texts_of(file: Path) -> Iterator[tuple[int, str]]:
    """Return docstrings and texts with at least two words that may contain a word of the list.

    Each with its line. Most files are not parsed, as no such word is in them.
    """
    source = file.read_text(encoding="utf-8")
    plain = BETWEEN_WORDS.sub(" ", source).lower()
    # Ten times as fast as the search for the pattern.
    if not any(word in plain for word in ALL_WORDS):
        return
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value


def advice_on(text: str) -> list[str]:
    """Return one line of advice for each word of ``text`` that is on the list."""
    advice = tuple(WORDS.values())
    return [
        f"{match.group()!r}: {advice[int((match.lastgroup or 'w0')[1:])]}"
        for match in PATTERN.finditer(" ".join(text.split()))
    ]


def test_docstrings_begin_with_a_verb_or_a_noun() -> None:
    wrong = [
        f"{file.relative_to(ROOT)}: {match[1]}"
        for file in python_files()
        for match in OPENING.finditer(file.read_text(encoding="utf-8"))
    ]
    assert not wrong, f"{len(wrong)} docstrings\n" + "\n".join(wrong)


def test_texts_in_code_avoid_the_words_on_the_list() -> None:
    wrong = [
        f"{file.relative_to(ROOT)}:{line}: {advice}"
        for file in python_files()
        if file != Path(__file__)
        for line, text in texts_of(file)
        for advice in advice_on(text)
    ]
    assert not wrong, f"{len(wrong)} texts\n" + "\n".join(wrong)


def test_documentation_and_page_avoid_the_words_on_the_list() -> None:
    files = [*ROOT.glob("*.md"), *(file for name in PROSE for file in (ROOT / name).rglob("*.md"))]
    page = [file for file in (ROOT / "static").rglob("*") if file.suffix in PAGE]
    files += [file for file in page if file.parent.name != "uplot"]
    wrong = [
        f"{file.relative_to(ROOT)}: {advice}"
        for file in sorted(files)
        for advice in advice_on(file.read_text(encoding="utf-8"))
    ]
    assert not wrong, f"{len(wrong)} places\n" + "\n".join(wrong)


def test_words_are_found_in_texts_of_several_parts(tmp_path: Path) -> None:
    file = tmp_path / "words.py"
    file.write_text('NAME = "Vera"\nTEXT = (\n    "is "\n    f"told\\nwhoever {NAME}"\n)\n')
    advice_given = [advice for _, text in texts_of(file) for advice in advice_on(text)]
    assert [advice.partition(":")[0] for advice in advice_given] == ["'is told'", "'whoever'"]
    file.write_text('"""It goes\non."""\n')
    assert len([advice for _, text in texts_of(file) for advice in advice_on(text)]) == 1
