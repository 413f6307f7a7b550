"""The import benchmark works, and the import is as fast as promised."""

from __future__ import annotations

from benchmarks.import_time import CASES, REFERENCE, measured, rows

PROMISED = 0.3
"""[s] Maximum time of the import."""


def test_import_takes_less_than_numpy_alone() -> None:
    library, numpy = "`import katana450`", REFERENCE
    times = measured(2, {name: CASES[name] for name in (numpy, library)})
    assert min(times[library]) < min(PROMISED, *times[numpy])
    table = rows(times)
    assert [line.split(" | ")[0] for line in table[2:]] == [f"| {numpy}", f"| {library}"]
    assert table[2].endswith("| 1 |")
