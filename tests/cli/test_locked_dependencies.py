"""What ``make run`` installs: everything that the README shows first, reports among it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NAME = re.compile(r"^[a-z0-9][a-z0-9._-]*")


def test_libraries_of_a_report_are_in_the_lock_file_of_make_run() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["report"]]
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    locked = {found[0] for line in lock.splitlines() if (found := NAME.match(line))}
    assert {match[0] for text in wanted if (match := NAME.match(text))} <= locked


def test_documentation_of_a_report_names_no_further_installation() -> None:
    for page in ("README.md", "docs/programs.md", "docs/exchange.md"):
        assert "[report]" not in (ROOT / page).read_text(encoding="utf-8"), page
