"""The scripts of the page are in strict types, by `make check-js`, and nothing escapes it."""

from __future__ import annotations

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
JAVASCRIPT = ROOT / "tests" / "javascript"

ESCAPE = re.compile(r"@ts-|(?:[{:<|,=(] ?|\[)any(?= ?[}\])>|,;])|\{(?:Function|Object|\*)\}")
"""Pattern of a type that is not checked, and of a comment that turns the check off."""


def test_all_scripts_are_checked_in_strict_types() -> None:
    config = json.loads((JAVASCRIPT / "tsconfig.json").read_text(encoding="utf-8"))
    options = config["compilerOptions"]
    assert options["strict"] is True
    assert options["checkJs"] is True
    assert not {name for name in options if name.startswith("strict") and not options[name]}
    assert config["include"] == ["../../static/**/*.js", "*.d.ts"]
    assert "exclude" not in config


def test_no_type_of_the_page_is_left_open() -> None:
    assert ESCAPE.search("/** @type {any} */")
    assert ESCAPE.search("/** @param {Map<string, any>} values */")
    assert ESCAPE.search("interface Window { viewer?: any; }")
    files = [*(ROOT / "static").rglob("*.js"), *JAVASCRIPT.glob("*.d.ts")]
    assert len(files) > 60
    escapes = {
        f"{file.name}:{number}"
        for file in files
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if ESCAPE.search(line)
    }
    assert not escapes


def test_files_and_functions_of_the_page_are_short() -> None:
    rules = (JAVASCRIPT / "eslint.config.js").read_text(encoding="utf-8")
    assert '"max-lines": ["error", 400]' in rules
    assert '"max-lines-per-function": ["error", 80]' in rules
