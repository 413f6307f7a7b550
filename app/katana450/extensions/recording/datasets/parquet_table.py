"""Recordings as Parquet files: the columns of the CSV file, with their units."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from katana450.atomic import write_files
from katana450.extensions.recording.datasets.recorded_robot import recorded_robot
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import setpoint_table
from katana450.extras import library


def arrow() -> tuple[Any, Any]:
    """Return the modules ``pyarrow`` and ``pyarrow.parquet``.

    Raises MissingExtraError if pyarrow is not installed.
    """
    what = "Parquet files and LeRobot datasets"
    return library("pyarrow", "datasets", what), library("pyarrow.parquet", "datasets", what)


COPIED = ("robot", "urdf", "urdf_sha256", "utc_offset_ns", "version")
"""Metadata of the recording that the file has too."""


def write_parquet(
    file: RecordingFile, out: Path, start: float = -math.inf, end: float = math.inf
) -> int:
    """Write the setpoints as a Parquet file and return the number of its rows.

    The columns are those of the CSV file, with the metadata ``unit`` each: s, rad or m. Raises
    InputError, and ConfigurationError without pyarrow.
    """
    pa, parquet = arrow()
    table = setpoint_table(file, start, end)
    units = _units(file)
    schema = pa.schema(
        [
            pa.field(name, pa.float64(), nullable=False, metadata={"unit": units[name]})
            for name in table
        ],
        metadata={name: file.metadata[name] for name in COPIED if name in file.metadata},
    )
    content = pa.table(list(table.values()), schema=schema)
    write_files({out: lambda target: parquet.write_table(content, target)})
    return int(content.num_rows)


def _units(file: RecordingFile) -> dict[str, str]:
    """Return the unit of each column."""
    robot = recorded_robot(file)
    arm = robot.arm
    names = robot.joint_group.names if arm is None else arm.chain.names
    slides = {name: joint.slides for name, joint in robot.joints.items()}
    found = {"t": "s"}
    found.update({f"theta{axis}": _unit(slides[each]) for axis, each in enumerate(names, start=1)})
    if arm is not None:
        found["gripper"] = _unit(any(slides[each] for each in arm.fingers))
    return found


def _unit(slides: bool) -> str:
    return "m" if slides else "rad"
