"""The files that services around the repository read are valid, and all versions agree."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import check_jsonschema
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]

MAX_LINES = 600
"""Maximum length of a file, with comments and docstrings."""

MAX_UNRELEASED = 60
"""Maximum number of lines about what no version has yet, so that people read them."""

SCHEMAS = {
    "github-workflows": ".github/workflows/*.yml",
    "github-issue-forms": ".github/ISSUE_TEMPLATE/[!c]*.yml",
    "github-issue-config": ".github/ISSUE_TEMPLATE/config.yml",
    "dependabot": ".github/dependabot.yml",
    "citation-file-format": "CITATION.cff",
    "compose-spec": "compose.yaml",
}


@pytest.mark.parametrize("schema", SCHEMAS)
def test_file_keeps_its_schema(schema: str) -> None:
    files = [str(file) for file in ROOT.glob(SCHEMAS[schema])]
    assert files
    with pytest.raises(SystemExit) as ended:
        check_jsonschema.main(["--builtin-schema", f"vendor.{schema}", *files])
    assert ended.value.code == 0


def test_workflows_call_targets_of_make() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8").splitlines()
    targets = {line.partition(":")[0] for line in makefile if ":" in line}
    for file in ROOT.glob(".github/workflows/*.yml"):
        jobs = yaml.safe_load(file.read_text(encoding="utf-8"))["jobs"]
        steps = [step.get("run", "") for job in jobs.values() for step in job["steps"]]
        called = {step.split()[1] for step in steps if step.startswith("make ")}
        assert called <= targets, file.name


def test_python_files_have_at_most_600_lines() -> None:
    folders = ("app", "benchmarks", "docs", "examples", "plugins", "robot_description", "tests")
    files = [file for folder in folders for file in (ROOT / folder).rglob("*.py")]
    assert len(files) > 1000
    lines = {file: file.read_bytes().count(b"\n") for file in files}
    assert not {str(file): count for file, count in lines.items() if count > MAX_LINES}


def test_every_dependency_has_a_reason() -> None:
    about = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    lists = (
        about["project"]["dependencies"],
        *about["project"]["optional-dependencies"].values(),
        *about["dependency-groups"].values(),
    )
    words = [word for group in lists for word in group if isinstance(word, str)]
    names = {re.split(r"[^\w.-]", word)[0].lower() for word in words}
    assert {"numpy", "pyserial", "pytest"} < names
    reasons = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8").lower()
    assert not {name for name in names if f"[{name}]" not in reasons}


def test_version_has_an_entry_in_the_changelog_with_its_date() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == project["version"]
    heading = f"## [{cited['version']}] - {cited['date-released']}"
    assert heading in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()


def test_changelog_dates_its_releases_and_says_briefly_what_is_unreleased() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    unreleased, *releases = re.split(r"^## ", text, flags=re.MULTILINE)[1:]
    assert unreleased.startswith("[Unreleased]\n")
    assert unreleased.count("\n") <= MAX_UNRELEASED
    assert releases
    dated = re.compile(r"\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d\n")
    assert [release for release in releases if dated.match(release) is None] == []
