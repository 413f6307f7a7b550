"""``katana450 workspace``: map the points that the tool reaches, and its orientations there."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from katana450.assembly.robot_files import read_robot
from katana450.assembly.robot_session import find_arm
from katana450.atomic import Writer, check_writable, write_files
from katana450.errors import InputError
from katana450.extensions.progress import progress
from katana450.extensions.reachability.cluster import connect_cluster
from katana450.extensions.reachability.grid import IntArray
from katana450.extensions.reachability.map import ReachabilityMap, Survey
from katana450.extensions.reachability.reachability_file import write_npz, write_ply
from katana450.extensions.reachability.survey_of import MapOptions, survey_of
from katana450.settings import Settings


def workspace(options: argparse.Namespace) -> int:
    """Map the workspace, write the requested files, print a summary. Raises InputError."""
    _check_files(options.out, options.ply)
    robot = read_robot(options.urdf, options.tool, find_arm)
    arm = robot.require_arm()
    for note in (*arm.notes, *robot.notes):
        print(f"katana450: {note}", file=sys.stderr)
    tool = arm.default_tool
    survey = survey_of(
        arm.chain_to(tool),
        arm.T_base_shoulder,
        arm.ready(Settings.ready),
        MapOptions(
            1e-3 * options.table,
            None if options.voxel is None else 1e-3 * options.voxel,
            options.pitches,
            options.rolls,
            options.samples,
            options.seed,
        ),
    )
    found = survey.map(_counts(survey, options.scheduler))
    files: dict[Path, Writer] = {}
    if options.out:
        files[options.out] = lambda file: write_npz(file, survey, found, robot.name, tool)
    if options.ply:
        files[options.ply] = lambda file: write_ply(file, found)
    write_files(files)
    print(_summary(survey, found, tool))
    for path in files:
        print(f"Written: {path}")
    return 0


def _check_files(out: Path | None, ply: Path | None) -> None:
    for path, suffix in ((out, ".npz"), (ply, ".ply")):
        if path is not None:
            if path.suffix.lower() != suffix:
                raise InputError(f"{path} must end in {suffix}.")
            check_writable(path)


def _counts(survey: Survey, scheduler: str | None) -> list[IntArray]:
    """Return the counts of all chunks in their order, computed here or on a cluster."""
    chunks = survey.chunks()
    with ExitStack() as stack:
        arriving: Iterator[tuple[int, IntArray]]
        if scheduler is None:
            arriving = ((number, survey.count(chunk)) for number, chunk in enumerate(chunks))
        else:
            arriving = stack.enter_context(connect_cluster(scheduler)).counts(survey, chunks)
        found = dict(progress(arriving, len(chunks), "Mapping the workspace"))
    return [found[number] for number in range(len(chunks))]


def _summary(survey: Survey, found: ReachabilityMap, tool: str) -> str:
    reachability = survey.reachability
    if not len(found.points):
        return f"The tool {tool} reaches no voxel. Choose smaller voxels or a lower table."
    litres = 1e3 * len(found.points) * survey.voxel**3
    low, high = (1e3 * edge(found.points, axis=0) for edge in (np.min, np.max))
    extent = ", ".join(
        f"{name} {a:.0f} … {b:.0f}" for name, a, b in zip("xyz", low, high, strict=True)
    )
    best = found.points[int(np.argmax(found.fraction))]
    where = ", ".join(f"{1e3 * value:.0f}" for value in best)
    reached = (
        f"The tool {tool} reaches {len(found.points)} voxels of {1e3 * survey.voxel:g} mm, "
        f"{litres:.1f} litres above the table at {1e3 * reachability.table:g} mm:\n"
        f"{extent} mm in the base frame."
    )
    if reachability.orientations == 1:
        return f"{reached}\nThe arm cannot choose its orientation there, so it is not mapped."
    if found.at_home is not None:
        fraction = found.at_home.mean()
        reached += f"\nIn {fraction:.1%} of them it can have the orientation that it has at Home."
    return (
        f"{reached}\n"
        f"Of {reachability.orientations} orientations {found.fraction.mean():.1%} on average, "
        f"up to {found.fraction.max():.1%} at {where} mm."
    )
