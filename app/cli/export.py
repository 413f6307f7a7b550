"""``katana450 export``: the arm, or any other mechanism, as files for other programs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from app.errors import InputError
from app.exchange.atomic import write_files, writer_of
from app.exchange.c_source import c_files
from app.exchange.glb import glb_files
from app.exchange.mechanism import Mechanism
from app.exchange.trajectory_file import Motion, load_motion
from app.exchange.urdf_mechanism import load_mechanism
from app.exchange.urdf_package import package_files
from app.exchange.vrml import vrml_files

MOVES = ("vrml", "glb")
"""Formats a motion survives in."""

POSED = ("vrml", "c", "glb")
"""Formats that stand in a pose."""


def export(options: argparse.Namespace) -> int:
    """Write the files of one format; tell their names and sizes."""
    kind: str = options.format
    if options.trajectory is not None and kind not in MOVES:
        raise InputError(f"A file of {kind} holds no motion; {' and '.join(MOVES)} do.")
    if options.run is not None:
        raise InputError(f"A file of {kind} holds no run; html does.")
    if options.pose and kind not in POSED:
        raise InputError(f"A file of {kind} stands in no pose; {', '.join(POSED)} do.")
    mechanism, notes = load_mechanism(options.urdf)
    for note in notes:
        print(f"katana450: {note}", file=sys.stderr)
    values = mechanism.values(options.pose)
    motion = None if options.trajectory is None else load_motion(options.trajectory, mechanism)
    made = _made(kind, mechanism, values, motion, options.urdf)
    folder: Path = options.out
    try:
        for path in {(folder / name).parent for name in made}:
            path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror or error}.") from error
    write_files({folder / name: writer_of(content) for name, content in made.items()})
    for name, content in made.items():
        print(f"{folder / name}: {len(content)} bytes")
    return 0


def _made(
    kind: str,
    mechanism: Mechanism,
    values: Mapping[str, float],
    motion: Motion | None,
    urdf: Path,
) -> Mapping[str, bytes]:
    match kind:
        case "vrml":
            return vrml_files(mechanism, values, motion)
        case "c":
            return c_files(mechanism, values)
        case "glb":
            return glb_files(mechanism, values, motion)
    return package_files(urdf)
