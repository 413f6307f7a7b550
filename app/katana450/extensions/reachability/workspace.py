"""``katana450 workspace``: map the points that the tool reaches, and its orientations there."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import signal
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from katana450.assembly.robot_files import read_robot
from katana450.assembly.robot_session import find_arm
from katana450.atomic import check_writable, write_files
from katana450.errors import InputError
from katana450.extensions.progress import progress
from katana450.extensions.reachability.map import ReachabilityMap, Survey, survey_of
from katana450.extensions.reachability.reachability import IntArray
from katana450.extensions.reachability.reachability_file import StoredMap, write_npz

MIN_SHARED_CHUNKS = 8
"""Number of chunks from which on starting further processes saves time."""


def workspace(options: argparse.Namespace) -> int:
    """Map the workspace, write the requested file, print a summary. Raises InputError."""
    out: Path | None = options.out
    if out is not None:
        if out.suffix.lower() != ".npz":
            raise InputError(f"{out} must end in .npz.")
        check_writable(out)
    robot = read_robot(options.urdf, options.tool, find_arm)
    arm = robot.require_arm()
    for note in (*arm.notes, *robot.notes):
        print(f"katana450: {note}", file=sys.stderr)
    tool = arm.default_tool
    voxel = None if options.voxel is None else 1e-3 * options.voxel
    chain, T = arm.chain_to(tool), arm.T_base_shoulder
    survey = survey_of(chain, T, 1e-3 * options.table, voxel)
    reach_map = survey.map(_counts(survey))
    if out is not None:
        points, fraction = reach_map.points, reach_map.fraction
        table = survey.reachability.table
        stored = StoredMap(points, fraction, survey.voxel, table, robot.name, tool)
        write_files({out: lambda file: write_npz(file, stored)})
    print(_summary(survey, reach_map, tool))
    if out is not None:
        print(f"Written: {out}")
    return 0


def _counts(survey: Survey) -> list[IntArray]:
    """Return the counts of all chunks in their order, computed by all cores."""
    chunks = survey.chunks()
    label = "Mapping the workspace"
    if len(chunks) < MIN_SHARED_CHUNKS:
        return [survey.count(chunk) for chunk in progress(chunks, len(chunks), label)]
    # The same code computes each chunk, so the number of processes changes no bit.
    context = multiprocessing.get_context("spawn")
    workers = min(os.cpu_count() or 1, len(chunks))
    with ProcessPoolExecutor(workers, context, _ignore_interrupts) as pool:
        futures = [pool.submit(survey.count, chunk) for chunk in chunks]
        try:
            return [future.result() for future in progress(futures, len(futures), label)]
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _ignore_interrupts() -> None:
    # Ctrl-C is handled by the process that writes the files.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _summary(survey: Survey, reach_map: ReachabilityMap, tool: str) -> str:
    reachability = survey.reachability
    if not len(reach_map.points):
        return f"The tool {tool} reaches no voxel. Choose smaller voxels or a lower table."
    litres = 1e3 * len(reach_map.points) * survey.voxel**3
    low, high = (1e3 * edge(reach_map.points, axis=0) for edge in (np.min, np.max))
    extent = ", ".join(
        f"{name} {a:.0f} … {b:.0f}" for name, a, b in zip("xyz", low, high, strict=True)
    )
    best = reach_map.points[int(np.argmax(reach_map.fraction))]
    where = ", ".join(f"{1e3 * value:.0f}" for value in best)
    reached = (
        f"The tool {tool} reaches {len(reach_map.points)} voxels of {1e3 * survey.voxel:g} mm, "
        f"{litres:.1f} litres above the table at {1e3 * reachability.table:g} mm:\n"
        f"{extent} mm in the base frame."
    )
    if reachability.orientations == 1:
        return f"{reached}\nThe arm cannot choose its orientation there, so it is not mapped."
    return (
        f"{reached}\n"
        f"Of {reachability.orientations} orientations {reach_map.fraction.mean():.1%} on average, "
        f"up to {reach_map.fraction.max():.1%} at {where} mm."
    )
