"""``katana450 record``: list, describe, verify, cut and export recordings and episodes."""

from __future__ import annotations

import json
import math
import sys
from argparse import Namespace
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from katana450.arm.control.commands.act import MAX_WAIT
from katana450.assembly.log_output import printable
from katana450.errors import InputError, KatanaError
from katana450.extensions.progress import report
from katana450.extensions.recording.datasets.lerobot_export import (
    DEFAULT_OUTCOMES,
    Exported,
    LerobotOptions,
    export_lerobot,
    files_of,
)
from katana450.extensions.recording.datasets.ros_bag import write_bag
from katana450.extensions.recording.episodes.episode import Episode
from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder, episodes_in
from katana450.extensions.recording.files.header import (
    DISTANCES,
    differences,
    fingerprint,
)
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.script_runs import script_runs, sha256
from katana450.extensions.recording.files.simulation import check_inside, session_for, verified
from katana450.extensions.recording.files.table import write_csv
from katana450.extensions.recording.files.trimming import keep, trim
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.options import (
    DEFAULT_FPS,
    DEFAULT_SIZES,
    OPTION_NAMES,
    USED,
)
from katana450.extensions.recording.ticks import Verification

PROGRESS_STEP = 0.02
"""[1] Fraction of a recording after which the progress is shown again."""

MB = 1e6

SAME_PROGRAM = (
    "Program, libraries and processor are the same, so the recording was changed, or the process "
    "that made it rounded otherwise."
)

SAME = 1e-9
"""[rad or m] Difference of a setpoint that the rounding of distances can make."""

OTHER_DISTANCES = (
    "All setpoints are the same. Distances between bodies were measured by another library, and "
    "differ in their rounding."
)


def record(options: Namespace) -> int:
    """Run ``katana450 record`` and return the exit status: 1 if a verification finds a difference.

    Raises InputError for a file that cannot be used.
    """
    match options.act:
        case "keep":
            return _written(options.out, keep(options.folder, options.out, options.last))
        case "list":
            return _list(options.folder)
        case "info":
            return _info(options.file)
        case "verify":
            return _verify(options.file, options.urdf, as_json=options.json)
        case "fork":
            return _fork(options)
        case "trim":
            return _trim(options.files, options.out, options.start, options.end)
        case _:
            check_options(options)
            print(printable(f"{options.out}: {export(options)}."))
            return 0


def _list(folder: Path) -> int:
    if not folder.is_dir():
        raise InputError(f"There is no folder {folder}.")
    for path in recordings_in(folder):
        try:
            with RecordingFile.open(path) as file:
                length = f"{file.end - file.start:.1f} s"
                line = f"{path}  {_began(file)}  {length}  {file.size / MB:.1f} MB"
                print(printable("  ".join((line, *map(_about, episodes_in(file))))))
        except InputError as error:
            print(printable(f"{path}  {error}"), file=sys.stderr)
    for marker in EpisodeFolder(folder).markers():
        print(f"Episode {marker.episode.number} runs, or waits for the next start of its server.")
    return 0


def _about(episode: Episode) -> str:
    """Return number, outcome, task and remarks of ``episode`` in words."""
    missing = episode.missing_ticks
    gap = f"{missing} ticks of 10 ms are missing" if missing else ""
    remark = "; ".join(filter(None, (gap, episode.note)))
    about = f"episode {episode.number}, {episode.outcome.value}: {episode.task}"
    return f"{about} ({remark})" if remark else about


def _info(path: Path) -> int:
    with RecordingFile.open(path) as file:
        print(f"{path}: {file.end - file.start:.1f} s from {_began(file)}, {file.size / MB:.1f} MB")
        print(f"Times of its messages: {file.start:.3f} to {file.end:.3f} s")
        if not file.ended:
            print(
                "It has no end, as after a crash or while it is written; `record trim` makes one."
            )
        for topic, count in file.counts().items():
            print(printable(f"  {topic}: {count} messages"))
        for attachment in file.attachments():
            about = f"{len(attachment.data)} bytes, SHA-256 {sha256(attachment.data)}"
            print(printable(f"  attached: {attachment.name}, {about}"))
        for run in script_runs([file]):
            end = "" if run.end is None else f" to {run.end:.3f}"
            print(printable(f"  script {run.name} from {run.start:.3f}{end} s: {run.script}"))
        for name, value in sorted(file.metadata.items()):
            print(printable(f"  {name}: {value}"))
    return 0


def _verify(path: Path, urdf: Path | None, *, as_json: bool) -> int:
    if as_json:
        return _verify_for_programs(path, urdf)
    with RecordingFile.open(path) as file:
        result = verified(path, urdf, _Progress())
        print(f"{path}: {result}.")
        if result.ticks == 0:
            raise InputError(f"{path} has no tick that can be simulated.")
        if result.identical:
            return 0
        if same_setpoints(result, file.metadata):
            print(OTHER_DISTANCES)
            return 0
        others = differences(file.metadata)
        if others:
            print("It was made by another program or machine, whose rounding can differ:")
            for difference in others:
                print(printable(f"  {difference}"))
        else:
            print(SAME_PROGRAM)
    return 1


def same_setpoints(result: Verification, recorded: Mapping[str, str]) -> bool:
    """Return whether only distances differ, because another library measured them.

    ``recorded``: the fingerprint of the recording.
    """
    if result.largest is None or recorded.get(DISTANCES) == fingerprint()[DISTANCES]:
        return False
    return result.largest.size <= SAME


def _verify_for_programs(path: Path, urdf: Path | None) -> int:
    """Print the result, or what is wrong with the recording, as a JSON object."""
    try:
        result = verified(path, urdf, _Progress())
    except KatanaError as error:
        print(json.dumps({"error": str(error)}))
        return 1
    print(msgspec.json.encode(result).decode())
    return 0 if result.identical and result.ticks else 1


class _Progress:
    """Shows the progress on a terminal."""

    def __init__(self) -> None:
        self._shown = -1.0 if sys.stderr.isatty() else math.inf

    def __call__(self, t: float, length: float) -> None:
        """Show that ``t`` of ``length`` seconds are simulated."""
        fraction = t / max(length, PROGRESS_STEP)
        report(min(fraction, 1.0))
        if fraction >= self._shown + PROGRESS_STEP:
            self._shown = fraction
            print(f"\r{100.0 * fraction:3.0f} %", end="\r", file=sys.stderr, flush=True)


def _trim(paths: list[Path], out: Path, start: float, end: float) -> int:
    first = math.inf
    for path in paths:
        with RecordingFile.open(path) as file:
            first = min(first, file.start)
    return _written(out, trim(paths, out, first + start, first + end))


def _fork(options: Namespace) -> int:
    """Let the arm of a server continue, and wait until it rests. Raises KatanaError."""
    from katana450.client import connect

    with RecordingFile.open(options.file) as file:
        check_inside(file, options.at)
    with connect(options.url, "Terminal", options.token) as arm:
        about = f"Continuing {options.file} from {options.at:g} s. Ctrl-C holds the arm."
        print(printable(about), flush=True)
        try:
            state = arm.fork(options.at, options.file, MAX_WAIT)
        except KeyboardInterrupt:
            arm.hold()
            print("\nkatana450: the arm holds.", file=sys.stderr)
            return 130
    print(f"The arm is at rest. {state.why}".rstrip())
    return 0


def _written(out: Path, part: tuple[float, float]) -> int:
    print(printable(f"{out}: {part[1] - part[0]:.1f} s."))
    return 0


def _began(file: RecordingFile) -> str:
    """Return the time of the first message in UTC."""
    if not file.utc_offset:
        return "an unknown time"
    try:
        began = datetime.fromtimestamp(file.start + file.utc_offset, UTC)
    except (ValueError, OverflowError, OSError):
        return "an unknown time"
    return f"{began:%Y-%m-%d %H:%M:%S} UTC"


def check_options(options: Namespace) -> None:
    """Raise InputError for an option that the format does not have."""
    for name, formats in USED.items():
        if getattr(options, name) is not None and options.format not in formats:
            option = OPTION_NAMES.get(name, f"--{name}")
            raise InputError(
                f"{options.format} has no {option}. Use it with {' or '.join(formats)}."
            )


def export(options: Namespace) -> object:
    """Write the file or folder; return what it has, in words. Raises KatanaError."""
    if options.format == "lerobot":
        return _lerobot(options)
    if len(options.files) > 1:
        raise InputError("Only lerobot takes several files. Join those of one run: `record trim`.")
    with RecordingFile.open(options.files[0]) as file:
        start, end = file.start + options.start, min(file.start + options.end, file.end)
        if start > end:
            raise InputError(
                f"There is nothing from {options.start:g} to {options.end:g} s; the recording has "
                f"{file.end - file.start:.1f} s."
            )
        return _exported(options, file, start, end)


def _exported(options: Namespace, file: RecordingFile, start: float, end: float) -> str:
    """Write the part of ``file`` from ``start`` to ``end`` [s]; return what was written."""
    out: Path = options.out
    match options.format:
        case "csv":
            count, what = write_csv(file, out, start, end), "row"
        case "rosbag2":
            count, what = write_bag(file, out, start, end), "message"
        case _:
            count, what = _film(options, file, start, end), "picture"
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _film(options: Namespace, file: RecordingFile, start: float, end: float) -> int:
    """Write a film of the part of ``file``; return the number of its pictures."""
    from katana450.extensions.recording.datasets.player_files import (
        PictureViews,
        write_film_of,
    )

    views = options.views or ["free"]
    if len(views) > 1:
        raise InputError(f"A film has one view, not {len(views)}. Export one film for each.")
    size = options.size or DEFAULT_SIZES["mp4"]
    fps = DEFAULT_FPS["mp4"] if options.fps is None else options.fps
    pictures = PictureViews(views, size, options.urdf, file.settings.bare)
    robot = session_for(file, options.urdf)
    return write_film_of(file, options.out, (start, end), fps, robot, pictures, size)


def _lerobot(options: Namespace) -> Exported:
    views = tuple(dict.fromkeys(options.views or ()))
    size = options.size or DEFAULT_SIZES["lerobot"]
    request = LerobotOptions(
        fps=DEFAULT_FPS["lerobot"] if options.fps is None else options.fps,
        task=options.task or "",
        outcomes=options.outcomes or DEFAULT_OUTCOMES,
        part=(options.start, options.end),
        views=views,
        size=size,
        cameras=options.cameras,
    )
    if len(options.files) > 1 and request.part != (0.0, math.inf):
        raise InputError("--from and --to cut one recording; trim several one by one before.")
    if not views:
        return export_lerobot(options.files, options.out, request)
    from katana450.extensions.media.film import check_filmable
    from katana450.extensions.recording.datasets.player_files import PictureViews

    check_filmable(size, request.fps)
    with RecordingFile.open(files_of(options.files)[0]) as first:
        robot = session_for(first, options.urdf)
        pictures = PictureViews(views, size, options.urdf, first.settings.bare)
    return export_lerobot(options.files, options.out, request, robot.session, pictures.pictures)
