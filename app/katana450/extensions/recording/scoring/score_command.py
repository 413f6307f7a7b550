"""``katana450 score``: measures of recordings, as a table or as JSON."""

from __future__ import annotations

import json
import math
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from katana450.assembly.log_output import printable
from katana450.extensions.programs.script.measures import title_of, unit_of
from katana450.extensions.recording.episodes.episode_folder import shown_part
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import session_for
from katana450.extensions.recording.scoring.scored import (
    HIGHER_IS_BETTER,
    MEASURES,
    Scored,
    scored,
)

BEST = "*"
"""Mark of the best value of a measure."""

DIGITS = 4
"""Significant digits of a value."""


def is_best(scores: Sequence[Scored], score: Scored, measure: str) -> bool:
    """Return whether ``score`` has the best ``measure`` of ``scores``, and another a worse one."""
    known = [value for row in scores if (value := row.values[measure]) is not None]
    value = score.values[measure]
    # Values that differ by rounding are equal.
    if value is None or len(set(map(shown, known))) < 2:
        return False
    return shown(value) == shown((max if measure in HIGHER_IS_BETTER else min)(known))


def table_of(scores: Sequence[Scored]) -> list[str]:
    """Return a line for each measure that applies, with a column for each of ``scores``."""
    table = [["", *(score.name for score in scores)]]
    for measure in MEASURES:
        if all(score.values[measure] is None for score in scores):
            continue
        cells = [
            shown(score.values[measure]) + (f" {BEST}" if is_best(scores, score, measure) else "  ")
            for score in scores
        ]
        table.append([f"{name_of(measure)} {unit_of(measure)}".rstrip(), *cells])
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join((row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:]))).rstrip()
        for row in table
    ]


def name_of(measure: str) -> str:
    """Return the name of ``measure`` for people, without its unit."""
    return "SPARC" if measure == "sparc" else title_of(measure)


def shown(value: float | None) -> str:
    """Return ``value`` with DIGITS significant digits; a dash for None."""
    if value is None:
        return "–"
    if value != 0.0 and (abs(value) < 1e-3 or abs(value) >= 1e5):
        return f"{value:.2e}".replace("e+0", "e").replace("e-0", "e-")
    digits = DIGITS - 1 - (math.floor(math.log10(abs(value))) if value else 0)
    text = f"{value:.{max(digits, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def score_files(options: Namespace) -> int:
    """Run ``katana450 score`` and return the exit status. Raises InputError."""
    scores = [score_file(path, options.start, options.end, options.urdf) for path in options.files]
    # The fastest first; a score without a motion does not exist.
    scores.sort(key=lambda score: score.values["duration_s"] or 0.0)
    if options.json:
        print(json.dumps([{"name": score.name, **score.values} for score in scores], indent=2))
        return 0
    for line in table_of(scores):
        print(printable(line))
    if len(scores) > 1:
        print(f"Sorted by duration; {BEST} marks the best.")
    return 0


def score_file(
    path: Path,
    start: float | None = None,
    end: float | None = None,
    urdf: Path | None = None,
) -> Scored:
    """Return the score of the recording at ``path``.

    Args:
        path: file of the recording.
        start: [s] start of the part that counts; None: as ``shown_part`` says.
        end: [s] its end; None: as ``shown_part`` says.
        urdf: file of the recorded robot, if it is not that of this program.

    Raises InputError.
    """
    with RecordingFile.open(path) as file:
        robot = session_for(file, urdf)
        return scored(file, robot, *shown_part(file, start, end), name=path.name)
