"""The results of the benchmark as tables for people and as a record for programs."""

from __future__ import annotations

import dataclasses
import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.kinematics_quality import Quality
from benchmarks.kinematics_task import FloatArray

BEGIN = "<!-- kinematics: written by `make bench-kinematics ARGS=--docs` -->"
END = "<!-- kinematics: end -->"


@dataclass(frozen=True)
class Machine:
    """The machine of the measurement. load: 1-minute load average before and after."""

    processor: str
    cores: int
    python: str
    numpy: str
    load: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Row:
    """The results of one solver by block: microseconds per pose and their ratio to the reference.

    ``failed``: the reason if there are no results.
    """

    title: str
    version: str = ""
    microseconds: FloatArray = dataclasses.field(default_factory=lambda: np.empty(0))
    ratios: FloatArray = dataclasses.field(default_factory=lambda: np.empty(0))
    quality: Quality | None = None
    failed: str = ""


@dataclass(frozen=True, eq=False)
class Tables:
    """All results of one run."""

    poses: int
    blocks: int
    seed: int
    machine: Machine
    one_by_one: list[Row]
    batch: list[Row]


Cells = list[str]
_TIMES = ("µs, median", "µs, least")


def _single_cells(row: Row) -> Cells:
    found = _found(row)
    return [
        *_time_cells(row),
        _ratio(row),
        _fraction(found.solved),
        f"{1e3 * found.worst:.1e}",
        f"{found.branches:.2f}",
        f"{found.inside:.2f}",
        _fraction(found.usable),
    ]


def _batch_cells(row: Row) -> Cells:
    found = _found(row)
    return [*_time_cells(row), _ratio(row), _fraction(found.solved), f"{1e3 * found.worst:.1e}"]


def _time_cells(row: Row) -> Cells:
    return [_digits(value) for value in (np.median(row.microseconds), row.microseconds.min())]


def _ratio(row: Row) -> str:
    middle = np.median(row.ratios)
    return "–" if np.isnan(middle) else _digits(middle)


def _digits(value: float) -> str:
    return f"{value:.3g}" if value < 1e3 else f"{value:.0f}"


def _found(row: Row) -> Quality:
    assert row.quality is not None
    return row.quality


def _fraction(value: float) -> str:
    # Rounded down, so that 100 % always means all.
    return "100 %" if value == 1.0 else f"{np.floor(1e4 * value) / 1e2:.2f} %"


SINGLE_HEAD = (
    *("solver", "version", *_TIMES, "× katana450", "solved", "worst, mm", "branches"),
    *("inside limits", "usable"),
)


def batch_table(rows: Sequence[Row], reference: str) -> Iterator[str]:
    """Yield the lines of the table of all poses in one call, with ratios to ``reference``."""
    head = ("solver", "version", *_TIMES, f"× {reference}", "solved", "worst, mm")
    return _table(head, rows, _batch_cells)


def _table(
    head: Sequence[str], rows: Sequence[Row], cells: Callable[[Row], Cells]
) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield "|---|---" + "|--:" * (len(head) - 2) + "|"
    for row in rows:
        if row.failed:
            yield f"| {row.title} | {row.failed.replace('|', '/')} " + "| " * (len(head) - 2) + "|"
        else:
            yield f"| {' | '.join([row.title, row.version, *cells(row)])} |"


def conditions(poses: int, blocks: int, seed: int, machine: Machine) -> str:
    """Return a sentence on the poses and the machine."""
    before, after = machine.load
    return (
        f"{poses} poses of seed {seed} in {blocks} blocks; "
        f"{machine.processor}, {machine.cores} cores, {platform.system()}, Python "
        f"{machine.python}, numpy {machine.numpy}; load average {before:.1f} before and "
        f"{after:.1f} after, the benchmark's own process in it."
    )


def single_table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of the table of one pose a call."""
    return _table(SINGLE_HEAD, rows, _single_cells)


def markdown(tables: Tables) -> str:
    """Return both tables with the conditions of the measurement."""
    return "\n".join(
        [
            conditions(tables.poses, tables.blocks, tables.seed, tables.machine),
            "",
            "One pose a call:",
            "",
            *single_table(tables.one_by_one),
            "",
            f"All {tables.poses} poses in one call, µs a pose:",
            "",
            *batch_table(tables.batch, "C"),
        ]
    )


def text(tables: Tables) -> str:
    """Return the same with aligned columns, for a terminal."""
    lines = []
    block: list[list[str]] = []
    for line in [*markdown(tables).splitlines(), ""]:
        if line.startswith("|---"):
            continue
        if line.startswith("|"):
            block.append([cell.strip().replace("`", "") for cell in line.strip("|").split("|")])
            continue
        lines += _aligned(block)
        block = []
        lines.append(line)
    return "\n".join(lines)


def _aligned(block: list[list[str]]) -> list[str]:
    # A reason can be long. It stands in place of the figures and sets no width.
    full = [cells for cells in block if cells[-1]]
    widths = [max(map(len, column)) for column in zip(*full, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if number < 2 else cell.rjust(width)
            for number, (cell, width) in enumerate(zip(cells, widths, strict=True))
        ).rstrip()
        for cells in block
    ]


def record(tables: Tables) -> dict[str, Any]:
    """Return all figures and all single times as plain JSON values."""

    def plain(row: Row) -> dict[str, Any]:
        if row.failed:
            return {"solver": row.title, "failed": row.failed}
        return {
            "solver": row.title,
            "version": row.version,
            "microseconds": row.microseconds.tolist(),
            "median_microseconds": float(np.median(row.microseconds)),
            "least_microseconds": float(row.microseconds.min()),
            "median_ratio": float(np.median(row.ratios)),
            **dataclasses.asdict(_found(row)),
        }

    return {
        "poses": tables.poses,
        "blocks": tables.blocks,
        "seed": tables.seed,
        "machine": dataclasses.asdict(tables.machine),
        "one_by_one": [plain(row) for row in tables.one_by_one],
        "batch": [plain(row) for row in tables.batch],
    }


def write_into(path: Path, tables: Tables) -> None:
    """Write the tables between the marks in a document. Raises ValueError if it has no marks."""
    write_between(path, BEGIN, END, markdown(tables))


def write_between(path: Path, begin: str, end: str, text: str) -> None:
    """Write ``text`` between two lines of a document. Raises ValueError if it has them not."""
    document = path.read_text(encoding="utf-8")
    if document.count(begin) != 1 or document.count(end) != 1:
        raise ValueError(f"{path} must hold the lines {begin} and {end} once each")
    head, rest = document.split(begin)
    _, tail = rest.split(end)
    path.write_text(f"{head}{begin}\n{text}\n{end}{tail}", encoding="utf-8")


def processor() -> str:
    """Return the processor's name as the system gives it."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
