"""``katana450 score``: measures of recordings, as a table or as JSON."""

from __future__ import annotations

import json
import math
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from katana450.assembly.log_output import printable
from katana450.errors import InputError
from katana450.extensions.programs.script.measures import title_of, unit_of
from katana450.extensions.recording.episodes.episode_folder import shown_part
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import session_for
from katana450.extensions.recording.scoring.scored import (
    HIGHER_IS_BETTER,
    MEASURES,
    PLACING,
    Places,
    Scored,
    scored,
)

BEST = "*"
"""Mark of the best value of a measure."""

DIGITS = 4
"""Significant digits of a value."""


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """Scores in the order of one measure, the best first.

    Attributes:
        rows: the scores.
        measures: names of the measures that apply to any of them.
    """

    rows: tuple[Scored, ...]
    measures: tuple[str, ...]

    @staticmethod
    def of(scores: Sequence[Scored], by: str = "duration_s") -> Leaderboard:
        """Return the scores sorted ``by`` a measure. Raises InputError for an unknown one.

        Scores to which it does not apply come last.
        """
        check_measure(by)
        sign = -1.0 if by in HIGHER_IS_BETTER else 1.0

        def place(score: Scored) -> float:
            value = score.values[by]
            return math.inf if value is None else sign * value

        measures = tuple(
            name
            for name in MEASURES
            if any(row.values[name] is not None for row in scores)
            or (name == PLACING and any(row.missing for row in scores))
        )
        return Leaderboard(tuple(sorted(scores, key=place)), measures)

    def is_best(self, score: Scored, measure: str) -> bool:
        """Return whether ``score`` has the best value of ``measure``, and another a worse one."""
        known = [value for row in self.rows if (value := row.values[measure]) is not None]
        value = score.values[measure]
        # Values that differ by rounding are equal.
        if value is None or len(set(map(shown, known))) < 2:
            return False
        return shown(value) == shown((max if measure in HIGHER_IS_BETTER else min)(known))

    @property
    def lines(self) -> list[str]:
        """The table as text: a line for each measure, a column for each recording."""
        table = [["", *(f"{place}. {score.name}" for place, score in enumerate(self.rows, 1))]]
        if len(self.rows) == 1:
            table = [["", self.rows[0].name]]
        for measure in self.measures:
            cells = [
                shown(score.values[measure])
                + (f" {BEST}" if self.is_best(score, measure) else "  ")
                for score in self.rows
            ]
            table.append([f"{name_of(measure)} {unit_of(measure)}".rstrip(), *cells])
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        return [
            "  ".join((row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:]))).rstrip()
            for row in table
        ]

    @property
    def notes(self) -> list[str]:
        """A sentence about each recording that lacks objects with a target."""
        return [
            f"{row.name} has no object {', '.join(row.missing)}, so its placing error is unknown."
            for row in self.rows
            if row.missing
        ]

    @property
    def json(self) -> list[dict[str, Any]]:
        """The scores as JSON values, with units in the names, in their order."""
        return [
            {
                "name": row.name,
                **row.values,
                "missing_objects": list(row.missing),
                "places_mm": {
                    name: [round(1e3 * number, 3) for number in place.tolist()]
                    for name, place in row.places.items()
                },
            }
            for row in self.rows
        ]


def check_measure(name: str) -> None:
    """Raise InputError unless ``name`` is that of a measure."""
    if name not in MEASURES:
        raise InputError(f"There is no measure {name!r}. Known: {', '.join(MEASURES)}.")


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
    check_measure(options.sort)
    targets: dict[str, np.ndarray] = {}
    if options.like is not None:
        targets |= score_file(options.like, urdf=options.urdf).places
    targets |= {name: np.array(place) for name, place in options.target}
    scores = [
        score_file(path, options.start, options.end, targets, options.urdf)
        for path in options.files
    ]
    missing = [name for name, _ in options.target if all(name not in s.places for s in scores)]
    if missing:
        known = ", ".join(sorted({name for score in scores for name in score.places})) or "none"
        raise InputError(f"--target: there is no object {missing[0]!r}. Known objects: {known}.")
    board = Leaderboard.of(scores, options.sort)
    if options.json:
        print(json.dumps(board.json, indent=2))
    else:
        for line in board.lines:
            print(printable(line))
        for line in board.notes:
            print(printable(line))
        if len(scores) > 1:
            print(f"Sorted by {options.sort}; {BEST} marks the best.")
    return 0


def score_file(
    path: Path,
    start: float | None = None,
    end: float | None = None,
    targets: Mapping[str, np.ndarray] | Places | None = None,
    urdf: Path | None = None,
) -> Scored:
    """Return the score of the recording at ``path``.

    Args:
        path: file of the recording.
        start: [s] start of the part that counts; None: as ``shown_part`` says.
        end: [s] its end; None: as ``shown_part`` says.
        targets: places (3,) [m] where objects should end, by name; see ``scored``.
        urdf: file of the recorded robot, if it is not that of this program.

    Raises InputError.
    """
    with RecordingFile.open(path) as file:
        robot = session_for(file, urdf)
        return scored(file, robot, *shown_part(file, start, end), targets, name=path.name)
