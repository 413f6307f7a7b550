"""Exports of changed recordings raise errors for people only, and leave nothing half-done."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.cli.main import main
from katana450.errors import KatanaError
from katana450.extensions.recording.datasets.lerobot_export import LerobotOptions, export_lerobot
from katana450.extensions.recording.datasets.ros_bag import write_bag
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.files.simulation import verify_recording
from katana450.extensions.recording.files.table import RecordedStates
from katana450.extensions.recording.files.trimming import trim
from katana450.extensions.recording.messages import CHECKPOINTS, COMMANDS, EPISODES, EVENTS, STATE
from tests.conftest import LONG
from tests.recording.dataset_files import episode, write_copy
from tests.recording.recorded import described, record

# The time of a state is 1e300 s in number 233.
CHANGES = range(600) if LONG else (0, 1, 2, 3, 233)
ODD: tuple[Any, ...] = (
    None,
    True,
    -1,
    1e300,
    2**70,
    "nan",
    "",
    [],
    [1.0],
    {},
    [[1.0] * 6],
    "x" * 99,
)
TEXTS = ("", '{"tool":3,"bare":[]}', *(("[]", "-9" * 9, "../x", "\0") if LONG else ()))
CHANGED = (STATE, COMMANDS, CHECKPOINTS, EVENTS, EPISODES)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    record(folder / "plain.mcap", 30, 5)
    with RecordingFile.open(folder / "plain.mcap") as file:
        form = episode(file, 1, "success", part=(0.05, 0.2))
    return write_copy(folder / "plain.mcap", folder / "run.mcap", [form])


def changed(form: Any, chance: random.Random) -> Any:
    """Return ``form`` with one odd value somewhere, or without one of its entries."""
    if isinstance(form, dict) and form:
        name = chance.choice(sorted(form))
        if chance.random() < 0.1:
            return {key: value for key, value in form.items() if key != name}
        return {**form, name: changed(form[name], chance)}
    if isinstance(form, list) and form and chance.random() < 0.7:
        place = chance.randrange(len(form))
        return [*form[:place], changed(form[place], chance), *form[place + 1 :]]
    return chance.choice(ODD)


def changing(chance: random.Random) -> Callable[[Message], Message]:
    def change(message: Message) -> Message:
        if message.topic not in CHANGED or chance.random() > 0.1:
            return message
        if chance.random() < 0.05:
            return message._replace(data=message.data[:-1])
        form = changed(json.loads(message.data), chance)
        return message._replace(data=json.dumps(form).encode())

    return change


def exports(path: Path, out: Path) -> None:
    """Verify, cut and export ``path``; only errors for people are expected."""
    with RecordingFile.open(path) as file:
        times = np.linspace(file.start, min(file.end, file.start + 1.0), 5)
        for work in (
            lambda: verify_recording(file, described().session),
            lambda: trim([path], out / "part", file.start + 0.03, file.start + 0.09),
            lambda: write_bag(file, out / "bag"),
            lambda: list(RecordedStates(file, described().session).at(times)),
            lambda: export_lerobot([path], out / "set", LerobotOptions(30, "x")),
        ):
            with suppress(KatanaError):
                work()


@pytest.mark.parametrize("number", CHANGES)
def test_changed_recording_is_refused_or_exported(run: Path, tmp_path: Path, number: int) -> None:
    path = write_copy(run, tmp_path / "changed.mcap", change=changing(random.Random(number)))
    exports(path, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} <= {
        "changed.mcap", "part", "bag", "set",
    }  # fmt: skip


@pytest.mark.parametrize("topic", [COMMANDS, CHECKPOINTS])
@pytest.mark.parametrize("time", ["nan", "inf", "-inf"])
def test_time_that_is_no_number_is_refused(
    run: Path, tmp_path: Path, topic: str, time: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The limiter, compiled code, reads beyond its memory at such a time."""

    def change(message: Message) -> Message:
        if message.topic != topic:
            return message
        form = json.loads(message.data)
        (form if topic == COMMANDS else form["state"])["t"] = time
        return message._replace(data=json.dumps(form).encode())

    path = write_copy(run, tmp_path / "changed.mcap", change=change)
    assert main(["record", "verify", str(path)]) == 1
    expected = "Expected `float`" if topic == COMMANDS else "is not the time of a state"
    assert expected in capsys.readouterr().err


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", ["settings", "urdf", "urdf_sha256", "utc_offset_ns", "robot"])
def test_changed_metadata_are_refused_or_exported(run: Path, tmp_path: Path, name: str) -> None:
    for number, text in enumerate(TEXTS):
        path = write_copy(run, tmp_path / f"{number}.mcap", metadata={name: text})
        (tmp_path / str(number)).mkdir()
        exports(path, tmp_path / str(number))
