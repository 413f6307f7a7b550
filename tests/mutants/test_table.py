"""Test that the table of faults fits the files."""

from __future__ import annotations

from tests.mutants.mutant import ROOT, mutants


def test_each_fault_changes_one_place_and_has_tests() -> None:
    wrong = []
    for mutant in mutants():
        path = ROOT / mutant.file
        count = path.read_text(encoding="utf-8").count(mutant.old) if path.is_file() else 0
        absent = [path for path in mutant.tests.split() if not (ROOT / "tests" / path).is_file()]
        if count != 1 or absent or mutant.old == mutant.new:
            wrong.append((mutant.fault, count, absent))
    assert wrong == []


def test_there_are_faults_in_every_part() -> None:
    folders = [mutant.file.removeprefix("app/katana450/").split("/")[0] for mutant in mutants()]
    assert len(folders) >= 60
    assert set(folders) >= {"arm", "maths", "server", "extensions", "static"}
