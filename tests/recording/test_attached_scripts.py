"""The texts of scripts that run are attached to recordings, each once, where they ran."""

from __future__ import annotations

import hashlib
import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from rosbags.rosbag2 import Reader

import katana450
from katana450.arm.runtime.tick import TickRecord
from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.programs.script.script_files import script_text
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.recording_writer import MessageWriter
from katana450.extensions.recording.files.script_runs import FOLDER, script_runs
from katana450.extensions.recording.files.trimming import trim
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live import ring
from katana450.extensions.recording.live.ring import Ring
from katana450.extensions.recording.live.running_scripts import (
    MAX_RUNS,
    RunningScripts,
    ScriptNote,
)
from katana450.extensions.recording.playback.run import PlaybackRun
from tests.browser.server import AppServer
from tests.recording.recorded import header, run, swinging
from tests.waiting import until

TURN = "name: {name}\nsteps:\n  - joints: [{angle}, -60, 80, 20, 0]\n"
NOD = "name: Nod\nsteps:\n  - wait: 0.2\n  - joints: [5, -55, 80, 20, 0]\n"


def scripts_of(path: Path) -> dict[str, str]:
    """Return the texts of the scripts that are attached to the recording at ``path``."""
    with RecordingFile.open(path) as file:
        scripts = [script for script in file.attachments() if script.name.startswith(FOLDER)]
    assert len({script.name for script in scripts}) == len(scripts)
    return {script.name: script.data.decode() for script in scripts}


@pytest.fixture(scope="module")
def folder(server_folder: Path) -> Path:
    return server_folder


def kept(folder: Path, *options: str) -> Path:
    """Return a recording that is kept of the ring in ``folder``."""
    path = folder / "kept.mcap"
    assert main(["record", "keep", str(folder / "ring"), *options, "--out", str(path)]) == 0
    return path


LEFT, RIGHT = (TURN.format(name=f"Turn {angle}", angle=angle) for angle in (20, -20))


@pytest.fixture(scope="module")
def ran(shared_server: AppServer, folder: Path) -> tuple[Path, Path]:
    """Return a recording of four runs of three scripts, and the file of an episode of one."""
    named = folder / "nod.yaml"
    named.write_text(NOD, encoding="utf-8")
    with katana450.connect(shared_server.url, name="Ada") as client:
        client.run(LEFT)
        client.episodes.start("nod")
        assert main(["run", str(named), "--url", shared_server.url]) == 0
        episode = client.episodes.stop("success")
        for text in (LEFT, RIGHT):
            client.run(text)

    def has_all() -> bool:
        with suppress(InputError), RecordingFile.open(kept(folder)) as file:
            return [run.end is None for run in script_runs([file])] == [False] * 4
        return False

    until(lambda: recordings_in(folder / "ring"))
    until(has_all)
    path = kept(folder).rename(folder / "all.mcap")
    return path, folder / "episodes" / f"episode-{episode:04d}.mcap"


def test_texts_of_a_server_are_attached_once_with_their_runs(
    ran: tuple[Path, Path], folder: Path
) -> None:
    path, episode = ran
    nod = script_text(folder / "nod.yaml")
    scripts = scripts_of(path)
    assert sorted(scripts.values()) == sorted((LEFT, nod, RIGHT))
    for name, text in scripts.items():
        assert hashlib.sha256(text.encode()).hexdigest()[:12] in name
    programs = katana450.open(path).programs
    assert [program.name for program in programs] == ["Turn 20", "Nod", "Turn 20", "Turn -20"]
    assert [program.text for program in programs] == [LEFT, nod, LEFT, RIGHT]
    for program in programs:
        assert program.end is not None
        assert 0.1 < program.end - program.start < 20.0
    # The file of an episode has what ran in it.
    assert list(scripts_of(episode).values()) == [nod]
    # The timeline shows when each began and ended.
    shown = PlaybackRun(lambda: [path])
    shown.update()
    texts = [mark.text for mark in shown.marks() if mark.kind == "program"]
    assert texts[::2] == [f"Script {program.name} begins" for program in programs]
    for text, program in zip(texts[1::2], programs, strict=True):
        assert program.end is not None
        seconds = program.end - program.start
        assert text == f"Script {program.name} ends after {seconds:.0f} s"


def test_parts_have_the_scripts_that_ran_in_them(ran: tuple[Path, Path], folder: Path) -> None:
    path, part = ran[0], folder / "part.mcap"
    recording = katana450.open(path)
    first, second, _, last = recording.programs
    assert first.end is not None
    middle = second.start + 0.3 - recording.start
    for begin, end, text in (
        (last.start - recording.start, 1e3, RIGHT),
        (middle, middle + 0.1, second.text),
        (0.0, first.end - recording.start, LEFT),
    ):
        cut = ["trim", str(path), "--from", str(begin), "--to", str(end), "--out", str(part)]
        assert main(["record", *cut]) == 0
        assert list(scripts_of(part).values()) == [text]
        assert [program.text for program in katana450.open(part).programs] == [text]
        assert katana450.open(part).verify().identical
    # A part of that part has it, too.
    again = folder / "again.mcap"
    trim([part], again, 0.0, 1e9)
    assert list(scripts_of(again).values()) == [LEFT]


def test_info_and_export_keep_scripts(
    ran: tuple[Path, Path], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, broken, bag = ran[0], folder / "broken.mcap", folder / "bag"
    attached = scripts_of(path)
    assert main(["record", "info", str(path)]) == 0
    shown = capsys.readouterr().out
    for name, text in attached.items():
        digest = hashlib.sha256(text.encode()).hexdigest()
        assert f"attached: {name}, {len(text.encode())} bytes, SHA-256 {digest}" in shown
    assert shown.count("script Turn 20 from ") == 2
    broken.write_bytes(path.read_bytes()[:-200])
    assert scripts_of(broken) == attached
    assert main(["record", "export", str(path), "--format", "rosbag2", "--out", str(bag)]) == 0
    exported = {f"{FOLDER}{path.name}": path.read_text() for path in (bag / FOLDER).iterdir()}
    assert exported == attached
    with Reader(bag) as reader:
        assert reader.message_count > 100


def recorded_ring(folder: Path, times: tuple[tuple[float, float | None], ...]) -> RunningScripts:
    """Record 300 ticks from 1000 s in files of 100; scripts run at ``times`` [s]."""
    records: list[TickRecord] = []
    run(300, 1, records.append, swinging, odd=False)
    scripts = RunningScripts()
    store = Ring(folder, header(), scripts=scripts)
    for number, (began, ended) in enumerate(times):
        scripts.note(ScriptNote(f"S{number}", f"name: S{number}\n", began, ended))
    for number, record in enumerate(records):
        store.put(record)
        if number % 50 == 49:
            store.sync()
    store.close()
    return scripts


@pytest.mark.long
def test_each_file_of_a_ring_has_the_scripts_that_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ring, "MAX_FILE_TICKS", 100)
    folder = tmp_path / "ring"
    # One that ended before the first tick, one that ended, and one that runs to the end.
    scripts = recorded_ring(folder, ((900.0, 901.0), (1000.1, 1000.5), (1000.2, None)))
    files = recordings_in(folder)
    assert [list(scripts_of(file).values()) for file in files] == [
        ["name: S1\n", "name: S2\n"],
        ["name: S2\n"],
        ["name: S2\n"],
    ]
    for path in files:
        with RecordingFile.open(path) as file:
            (last,) = (run for run in script_runs([file]) if run.name == "S2")
        assert last.start == 1000.2
        assert last.end is None
    assert [run.name for run in scripts.read()] == ["S2"]


def test_same_text_is_attached_once_and_each_run_is_listed(tmp_path: Path) -> None:
    folder, scripts = tmp_path / "ring", RunningScripts()
    records: list[TickRecord] = []
    run(50, 1, records.append, swinging, odd=False)
    store = Ring(folder, header(), scripts=scripts)
    for began in (1000.1, 1000.2):
        # Names become names of files.
        scripts.note(ScriptNote("../a b", "name: ../a b\nsteps: []\n", began, began + 0.05))
    scripts.note(ScriptNote("late", "steps: []\n", 1001.0, 1002.0))
    store.put_all(records)
    store.close()
    assert [run.name for run in scripts.read()] == ["late"]
    (path,) = recordings_in(folder)
    ((name, _),) = scripts_of(path).items()
    assert re.fullmatch(r"scripts/a-b-[0-9a-f]{12}\.yaml", name)
    programs = katana450.open(path).programs
    assert [(program.name, program.start) for program in programs] == [
        ("../a b", 1000.1),
        ("../a b", 1000.2),
    ]
    assert [program.end for program in programs] == pytest.approx([1000.15, 1000.25])


def test_notes_that_nobody_takes_are_bounded() -> None:
    scripts = RunningScripts()
    for number in range(MAX_RUNS + 5):
        scripts.note(ScriptNote(f"S{number}", "", float(number)))
    assert [run.name for run in scripts.read()] == [f"S{n}" for n in range(5, MAX_RUNS + 5)]


def test_changed_text_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "ring"
    recorded_ring(folder, ((1000.1, None),))
    (path,) = recordings_in(folder)
    content = path.read_bytes()
    assert content.count(b"name: S0\n") == 1
    changed = tmp_path / "changed.mcap"
    with RecordingFile.open(path) as file, changed.open("wb") as out:
        attachments = [
            replace(part, data=part.data.replace(b"S0", b"S1")) for part in file.attachments()
        ]
        copy = MessageWriter(out, file.metadata, attachments)
        for message in file.messages(*file.counts()):
            copy.copy(message)
        copy.finish()
    with pytest.raises(InputError, match="is not the text that ran"):
        _ = katana450.open(changed).programs
