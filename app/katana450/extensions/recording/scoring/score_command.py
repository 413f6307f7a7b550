"""``katana450 score``: measures of recordings, as a table or as JSON."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from katana450.assembly.log_lines import printable
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode_file import shown_part
from katana450.extensions.recording.files.checking import session_for
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.scoring.leaderboard import BEST, Leaderboard, check_measure
from katana450.extensions.recording.scoring.scored import Places, Scored, scored


def score_files(options: Namespace) -> int:
    """Run ``katana450 score`` and return the exit status. Raises InputError."""
    check_measure(options.sort)
    targets: dict[str, np.ndarray] = {}
    if options.like is not None:
        targets |= score_file(options.like, urdf=options.urdf).places
    targets |= {name: np.array(place) for name, place in options.target}
    found = [
        score_file(path, options.start, options.end, targets, options.urdf)
        for path in options.files
    ]
    missing = [name for name, _ in options.target if all(name not in s.places for s in found)]
    if missing:
        known = ", ".join(sorted({name for each in found for name in each.places})) or "none"
        raise InputError(f"--target: there is no object {missing[0]!r}. Known objects: {known}.")
    board = Leaderboard.of(found, options.sort)
    if options.json:
        print(json.dumps(board.json, indent=2))
    else:
        for line in board.lines:
            print(printable(line))
        for line in board.notes:
            print(printable(line))
        if len(found) > 1:
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
