"""``katana450 record episodes``: record, judge and list episodes."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from katana450.assembly.log_lines import printable
from katana450.client.episodes import EpisodeClient
from katana450.client.files import Site
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode_folder import DISCARDED, EpisodeFolder
from katana450.extensions.recording.episodes.interrupted import finish_interrupted

NAME = "Terminal"
"""Name of this client, which others see."""


def episodes(options: Namespace) -> int:
    """Run ``katana450 record episodes`` and return the exit status. Raises KatanaError."""
    match options.episode_act:
        case "list" if options.folder is not None:
            return _list_folder(options.folder)
        case "recover":
            return _recover(options.folder)
    return _ask(options, EpisodeClient(Site(options.url, options.token, NAME)))


def _ask(options: Namespace, server: EpisodeClient) -> int:
    """Send the request of ``options`` to ``server`` and print what it did."""
    match options.episode_act:
        case "list":
            for each in server.list():
                length = each.end - each.start
                remark = _remark(each.missing_ticks, each.note)
                _show(each.number, length, each.outcome, each.task, remark)
            return 0
        case "start":
            print(f"Episode {server.start(options.task)} is recorded.")
        case "stop":
            number = server.stop(options.outcome)
            print(f"Episode {number} has ended: {options.outcome}.")
            for each in server.list():
                if each.number == number and each.missing_ticks:
                    print(f"Its recording is incomplete: {_remark(each.missing_ticks)}.")
        case "judge":
            print(f"Episode {server.judge(options.outcome, options.number)}: {options.outcome}.")
        case "discard":
            print(f"Episode {server.discard(options.number)} is discarded.")
        case "restore":
            print(f"Episode {server.restore(options.number)} is kept again.")
        case "undo":
            print(f"Episode {server.undo()} is as before.")
        case "rerecord":
            print(f"Episode {server.rerecord()} is recorded in place of the last one.")
        case "describe":
            number = server.describe(options.number, task=options.task, note=options.note)
            print(f"Episode {number} is described.")
        case _:
            number = server.trim(options.number, options.start, options.end)
            print(f"Episode {number} is from {options.start:g} to {options.end:g} s of its file.")
    return 0


def _remark(missing_ticks: int, note: str = "") -> str:
    """Return the note of an episode, after what is missing of it."""
    missing = f"{missing_ticks} ticks of 10 ms are missing" if missing_ticks else ""
    return "; ".join(filter(None, (missing, note)))


def _show(number: int, length: float, outcome: str, task: str, remark: str) -> None:
    remark = f"  ({remark})" if remark else ""
    print(printable(f"{number:4}  {length:7.1f} s  {outcome:10}  {task}{remark}"))


def _list_folder(path: Path) -> int:
    """Print the episodes in the folder ``path``."""
    if not path.is_dir():
        raise InputError(f"There is no folder {path}.")
    folder = EpisodeFolder(path)
    for each in folder.kept():
        found = each.episode
        remark = _remark(found.missing_ticks, found.note)
        _show(found.number, found.length, found.outcome.value, found.task, remark)
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
    if not path.is_dir():
        raise InputError(f"There is no folder {path}.")
    folder = EpisodeFolder(path)
    folder.claim()
    try:
        said = finish_interrupted(folder, folder.markers())
    finally:
        folder.release()
    for each in said or ["No episode was interrupted."]:
        print(printable(each))
    return 0
