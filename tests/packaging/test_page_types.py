"""The scripts of the page are in strict types, by `make check-js`, and nothing escapes it."""

from __future__ import annotations

import hashlib
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
    assert config["exclude"] == ["../../static/uplot"]


def test_no_type_of_the_page_is_left_open() -> None:
    assert ESCAPE.search("/** @type {any} */")
    assert ESCAPE.search("/** @param {Map<string, any>} values */")
    assert ESCAPE.search("interface Window { viewer?: any; }")
    scripts = (file for file in (ROOT / "static").rglob("*.js") if file.parent.name != "uplot")
    files = [*scripts, *JAVASCRIPT.glob("*.d.ts")]
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


def test_library_for_plots_is_that_of_npm() -> None:
    """The name is that of the file in ``dist`` of uplot 1.6.32."""
    content = (ROOT / "static" / "uplot" / "uPlot.esm.js").read_bytes()
    assert hashlib.sha256(content).hexdigest() == (
        "5dd9b3281aa64b461b42d9945f6adb2649d346502b12281a9ae0d46599a80eba"
    )
