"""Recordings with episodes, as a server writes them, for tests of datasets."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.files.recording_writer import MessageWriter
from katana450.extensions.recording.messages import COMMANDS, EPISODES
from tests.recording.recorded import Commands, random_commands, record

BEGIN = 0.25
"""[s] Start of the episodes after that of their recordings."""

# Recordings of earlier versions have a key of the giver.
BY = {"name": "Ada", "role": "operator", "key": "0a1b2c3d4e5f"}


def write_copy(
    source: Path,
    out: Path,
    episodes: Iterable[Mapping[str, Any]] = (),
    metadata: Mapping[str, str] | None = None,
    gap: float | None = None,
    change: Callable[[Message], Message] = lambda message: message,
) -> Path:
    """Copy ``source`` to ``out``, with changes.

    Args:
        source: a recording.
        out: the copy.
        episodes: messages to add.
        metadata: metadata to change.
        gap: time after the start at which ticks are missing [s].
        change: changes each message.
    """
    with RecordingFile.open(source) as file, out.open("wb") as target:
        copy = MessageWriter(target, {**file.metadata, **(metadata or {})}, file.attachments())
        for message in file.messages(*file.counts()):
            if gap is not None and message.topic == COMMANDS and message.t > file.start + gap:
                lost = {"t": message.t, "missing": "the disk was slow", "ticks": 7}
                copy.copy(message._replace(data=json.dumps(lost).encode()))
                gap = None
            copy.copy(change(message))
        end = round(1e9 * file.end)
        for episode in episodes:
            copy.copy(Message(EPISODES, 0, end, json.dumps(episode).encode()))
        copy.finish()
    return out


def episode(
    file: RecordingFile,
    number: int,
    outcome: str,
    task: str = "pour the water",
    part: tuple[float, float] = (0.5, 2.0),
) -> dict[str, Any]:
    """Return the message of an episode of the ``part`` [s] of ``file``."""
    begin, end = (file.start + t for t in part)
    about = {"number": number, "task": task, "start": begin, "end": end, "outcome": outcome}
    return {"t": file.end, "kind": "judged", **about, "note": "", "by": BY}


def episode_folder(
    folder: Path, seeds: Mapping[str, int], commands: Commands = random_commands
) -> Path:
    """Make a folder of episodes, one for each outcome of ``seeds``, and a discarded one."""
    folder.mkdir()
    (folder / "discarded").mkdir()
    for number, (outcome, seed) in enumerate(seeds.items(), start=1):
        run = folder / f"run-{number}"
        record(run, 120 + 15 * number, seed, commands)
        name = f"episode-{number:04d}.mcap"
        with RecordingFile.open(run) as file:
            earlier = episode(file, number, "unjudged", "an older task")
            last = episode(file, number, outcome, part=(BEGIN, 1.0 + 0.1 * number))
            write_copy(run, folder / name, [earlier, last])
            if number == 1:
                write_copy(run, folder / "discarded" / "episode-0099.mcap", [last])
        run.unlink()
    return folder
