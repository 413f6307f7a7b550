"""``katana450 record episodes``: list and recover the episodes in a folder."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from katana450.assembly.log_output import printable
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode_folder import DISCARDED, EpisodeFolder
from katana450.extensions.recording.episodes.interrupted import finish_interrupted


def episodes(options: Namespace) -> int:
    """Run ``katana450 record episodes`` and return the exit status. Raises KatanaError."""
    path: Path = options.folder
    if not path.is_dir():
        raise InputError(f"There is no folder {path}.")
    return _list(path) if options.episode_act == "list" else _recover(path)


def _list(path: Path) -> int:
    """Print the episodes in the folder ``path``."""
    folder = EpisodeFolder(path)
    for each in folder.kept():
        found = each.episode
        missing = found.missing_ticks
        remarks = (f"{missing} ticks of 10 ms are missing" if missing else "", found.note)
        remark = "; ".join(filter(None, remarks))
        remark = f"  ({remark})" if remark else ""
        length, outcome = f"{found.length:7.1f} s", f"{found.outcome.value:10}"
        print(printable(f"{found.number:4}  {length}  {outcome}  {found.task}{remark}"))
    for why in folder.unreadable():
        print(printable(why))
    gone = len(folder.discarded())
    if gone:
        print(f"{gone} discarded, in {path / DISCARDED}")
    for marker in folder.markers():
        print(f"Episode {marker.episode.number} runs, or was interrupted.")
    return 0


def _recover(path: Path) -> int:
    """Finish interrupted episodes in the folder ``path``, which no server may use."""
    folder = EpisodeFolder(path)
    folder.claim()
    try:
        said = finish_interrupted(folder, folder.markers())
    finally:
        folder.release()
    for each in said or ["No episode was interrupted."]:
        print(printable(each))
    return 0
