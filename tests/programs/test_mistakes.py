"""Property tests: a script with any mistake is refused with its place, and never with a crash."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

from katana450.extensions.programs.language.source import Problem, ScriptError
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import library_file, script_text
from tests.conftest import LONG
from tests.programs.yaml_core import loaded

ROOT = Path(__file__).resolve().parents[2]
MISTAKES = 60 if LONG else 4
"""Number of mistakes in each script."""

WRONG_VALUES: tuple[Any, ...] = (
    None, True, [], {}, "", " ", "nowhere", "1 furlong", "2 * ", "3 deg", "4 mm", "5 s", "nan",
    ".inf", -1e9, 1e308, 10**40, 0, -1, 1.5, [1, 2], [[]], {"x": 1}, {"": ""}, "é\u200b", "$(rm)",
    "__import__('os')", "a" * 500, "((((", "9 ** 9 ** 9",
)  # fmt: skip
"""Values that are wrong at most places."""

Place = tuple[Any, Any]
"""A mapping or list, and the key or index of one of its values."""


def scripts() -> dict[str, str]:
    """Return valid scripts that together have every step."""
    paths = sorted((ROOT / "examples" / "programs").glob("*.yaml"))
    scripts = {path.stem: script_text(path) for path in paths}
    page = (ROOT / "docs" / "programs.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    scripts |= {f"docs {n}": block for n, block in enumerate(blocks) if "steps:" in block}
    return scripts | {name: script_text(library_file(name)) for name in ("circle", "pour")}


SCRIPTS = scripts()


def places(value: Any) -> Iterator[Place]:
    """Yield the place of every value in a script."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in pairs:
        yield value, key
        if isinstance(inner, dict | list):
            yield from places(inner)


def misspelt(random: Random, place: Place) -> None:
    parent, key = place
    if isinstance(parent, dict):
        index = random.randrange(len(str(key)) + 1)
        parent[f"{str(key)[:index]}{random.choice('axz_ ')}{str(key)[index:]}"] = parent.pop(key)


def removed(random: Random, place: Place) -> None:  # noqa: ARG001
    del place[0][place[1]]


def replaced(random: Random, place: Place) -> None:
    place[0][place[1]] = copy.deepcopy(random.choice(WRONG_VALUES))


def wrapped(random: Random, place: Place) -> None:
    inner = place[0][place[1]]
    place[0][place[1]] = random.choice(([inner], {"x": inner}, [inner, inner]))


def moved(random: Random, place: Place) -> None:
    """Swap the value with another one of the same parent."""
    parent, key = place
    other = random.choice(list(parent) if isinstance(parent, dict) else range(len(parent)))
    parent[key], parent[other] = parent[other], parent[key]


def added(random: Random, place: Place) -> None:
    parent, key = place
    if isinstance(parent, dict):
        parent[random.choice(("speed", "blend", "by", "at", "turns", "colour"))] = parent[key]
    else:
        parent.insert(key, copy.deepcopy(random.choice(WRONG_VALUES)))


CHANGES: tuple[Callable[[Random, Place], None], ...] = (
    misspelt, removed, replaced, replaced, wrapped, moved, added,
)  # fmt: skip


def mistaken(text: str, random: Random) -> str:
    """Return the script with one change at a random place."""
    script = loaded(text)
    random.choice(CHANGES)(random, random.choice(list(places(script))))
    dumped: str = yaml.safe_dump(script, sort_keys=False, allow_unicode=True)
    return dumped


def damaged(text: str, random: Random) -> str:
    """Return the text with some characters lost, doubled or replaced."""
    for _ in range(random.randrange(1, 4)):
        index = random.randrange(len(text))
        text = (
            text[:index]
            + random.choice(("", ":", "\t", "- ", "[", "}", "\n", "#", "&a ", "*a", "!!x "))
            + text[index + random.randrange(3) :]
        )
    return text


def problems_of(text: str) -> tuple[Problem, ...]:
    try:
        parse(text)
    except ScriptError as error:
        return error.problems
    return ()


def is_refused(text: str) -> bool:
    """Return whether the script is refused; every problem must have its place in the text."""
    problems, lines = problems_of(text), text.count("\n") + 2
    for problem in problems:
        assert 1 <= problem.line <= lines, problem
        assert problem.column >= 1, problem
        assert len(problem.text) > 8, problem
        assert "Traceback" not in problem.text, problem
        assert "object at 0x" not in problem.text, problem
    return bool(problems)


@pytest.mark.parametrize("name", SCRIPTS)
def test_wrong_fields_and_values_are_refused_with_their_place(name: str) -> None:
    random = Random(name)
    refused = [is_refused(mistaken(SCRIPTS[name], random)) for _ in range(MISTAKES)]
    # The others are still scripts, such as one with another text for people.
    assert sum(refused) > 0.2 * MISTAKES


@pytest.mark.parametrize("name", SCRIPTS)
def test_damaged_text_is_refused_with_its_place(name: str) -> None:
    random = Random(name)
    assert sum(is_refused(damaged(SCRIPTS[name], random)) for _ in range(MISTAKES)) > 0
