"""Time of ``import katana450`` and of a first call, beside ``import numpy``.

    python -m benchmarks.import_time

Every import runs in a fresh process that measures itself. The processes take turns, and each time
is divided by that of numpy in the same round. The start of Python is not counted.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
from collections.abc import Mapping

CASES = {
    "`import numpy`": "import numpy",
    "`import katana450`": "import katana450",
    "... and `load()`": "import katana450; katana450.load()",
    "... and `load().fk(q)`": "import katana450; katana450.load().fk([0.0] * 5)",
    "... and a circle planned": (
        "import katana450; katana450.load().circle((0.15, 0.0, -0.11), 0.1)"
    ),
}

REFERENCE = "`import numpy`"

ROUNDS = 9


def seconds(statement: str) -> float:
    """Return the time that ``statement`` take in a fresh process [s]."""
    timed = f"import time; t = time.perf_counter(); {statement}; print(time.perf_counter() - t)"
    done = subprocess.run(
        [sys.executable, "-c", timed], capture_output=True, text=True, check=True, timeout=120
    )
    return float(done.stdout)


def measured(rounds: int, cases: Mapping[str, str] = CASES) -> dict[str, list[float]]:
    """Return the times of each case [s], round by round; a first round warms the files."""
    times: dict[str, list[float]] = {name: [] for name in cases}
    for number in range(rounds + 1):
        for name, statement in cases.items():
            time = seconds(statement)
            if number:
                times[name].append(time)
    return times


def rows(times: dict[str, list[float]]) -> list[str]:
    """Return the lines of the table in docs/benchmarks.md."""
    lines = ["| | s, median | s, least | × numpy |", "|---|--:|--:|--:|"]
    for name, each in times.items():
        ratios = [a / b for a, b in zip(each, times[REFERENCE], strict=True)]
        lines.append(
            f"| {name} | {statistics.median(each):.3f} | {min(each):.3f} "
            f"| {statistics.median(ratios):.2g} |"
        )
    return lines


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="default: %(default)s")
    print("\n".join(rows(measured(parser.parse_args().rounds))))


if __name__ == "__main__":
    main()
