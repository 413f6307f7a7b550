"""Episodes are cut out of recordings, judged, discarded, brought back, and survive crashes."""

from __future__ import annotations

import errno
import json
import os
import shutil
import threading
from pathlib import Path

import pytest
from mcap.reader import make_reader
from msgspec import structs

import katana450
from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.recording.episodes import running_episode
from katana450.extensions.recording.episodes.episode import (
    Episode,
    EpisodeOutcome,
    episode_of,
)
from katana450.extensions.recording.episodes.episode_folder import (
    EpisodeFolder,
    EpisodeMarker,
    episode_files,
    only_episode,
    with_episode,
    write_episode,
)
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.files.simulation import verify_recording
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live import ring as ring_module
from katana450.extensions.recording.messages import COMMANDS, EPISODES, STATE
from katana450.server.api.episode_requests import episode_request
from tests.recording.episode_bench import ADA, Bench, motion
from tests.recording.recorded import described, header


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "run.mcap"
    with path.open("wb") as file:
        writer = RecordingWriter(file, header())
        for number, record in enumerate(motion()[:300]):
            writer.put(record)
            if number % 100 == 99:
                writer.flush()
        writer.close()
    return path


def attempt(path: Path, number: int = 1, **changes: object) -> Episode:
    """Return an episode in the middle of the recording ``path``."""
    with RecordingFile.open(path) as file:
        begin, end = file.start + 1.0, file.start + 2.5
    fields = {"task": "pour", "start": begin, "end": end, "note": "", **changes}
    return Episode(number=number, outcome=EpisodeOutcome.UNJUDGED, by=ADA, **fields)  # type: ignore[arg-type]


def test_episode_is_cut_out_of_a_recording(recorded: Path, tmp_path: Path) -> None:
    path, episode = tmp_path / "episode-0001.mcap", attempt(recorded)
    write_episode([recorded], path, episode)
    with RecordingFile.open(path) as file:
        assert only_episode(file) == episode
    opened = katana450.open(path)
    assert opened.episodes == (episode,)
    assert (opened.start, opened.end) == (episode.start, episode.end)
    assert opened.t[0] >= episode.start
    with RecordingFile.open(path) as file:
        assert file.counts()[STATE] > 50
        assert verify_recording(file, described().session).identical


def test_description_is_appended_without_changing_the_rest(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "episode-0001.mcap"
    before = attempt(recorded)
    write_episode([recorded], path, before)
    content = path.read_bytes()
    for outcome in (EpisodeOutcome.SUCCESS, EpisodeOutcome.FAILURE):
        after = attempt(recorded, note=outcome.value)
        after = structs.replace(after, outcome=outcome)
        with_episode(path, after, "judged")
        with RecordingFile.open(path) as file:
            assert only_episode(file) == after
    with RecordingFile.open(path) as file:
        assert file.counts()[EPISODES] == 4
        assert verify_recording(file, described().session).identical
        # The data before is the same, byte for byte.
        assert path.read_bytes()[: len(content) // 2] == content[: len(content) // 2]
    with path.open("rb") as stream:
        messages = list(make_reader(stream, validate_crcs=True).iter_messages(topics=[EPISODES]))
    assert [json.loads(message[2].data)["outcome"] for message in messages][-1] == "failure"
    with pytest.raises(InputError, match="is of episode 1, not 2"):
        with_episode(path, attempt(recorded, 2), "judged")


def test_episode_without_motion_in_its_time_is_refused(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="There is nothing"):
        write_episode([recorded], tmp_path / "x.mcap", attempt(recorded, start=1.0, end=2.0))
    assert not list(tmp_path.iterdir())


DESCRIBED = '{"number": 1, "task": "", "note": "", "by": {}, "end": null, "outcome": %s}'


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[", "description of an episode is wrong"),
        ("[]", "Expected `object`"),
        ('{"number": 0}', r"Expected `int` >= 1 - at `\$.number`"),
        (DESCRIBED % '"won", "start": 0', "Invalid enum value 'won'"),
        (DESCRIBED % '"success", "start": "x"', r"Expected `float`, got `str` - at `\$.start`"),
        (DESCRIBED % '"success", "start": 1e400', "Number out of range"),
        (DESCRIBED % '"success", "start": 1e30', r"Expected `float` < .* - at `\$.start`"),
        (DESCRIBED % '"success", "start": 1', "no end"),
        (DESCRIBED % '"success", "start": 2, "end": 1', "before its start"),
        (DESCRIBED % '"running", "start": 2, "task": 3', r"Expected `str`, got `int`"),
        ("[" * 100_000, "description of an episode is wrong"),
    ],
)
def test_wrong_description_is_refused(text: str, why: str) -> None:
    with pytest.raises(InputError, match=why):
        episode_of(text)


def test_episode_is_begun_and_judged(bench: Bench) -> None:
    bench.move(50)
    answer = bench.ask(do="start", task="pour")
    assert answer["number"] == 1
    bench.move(100)
    running = bench.keeper.status()["running"]
    assert running["number"] == 1
    assert running["seconds"] == int(bench.t - 1000.0 - (answer["start"] - 1000.0))  # type: ignore[operator]
    with pytest.raises(InputError, match="runs already"):
        bench.ask(do="start", task="again")
    bench.ask(do="judge", outcome="success")
    (entry,) = bench.folder.kept()
    assert entry.episode.outcome is EpisodeOutcome.SUCCESS
    assert entry.episode.task == "pour"
    assert entry.episode.start == answer["start"]
    assert entry.episode.end == bench.t
    # All ticks between are there, and nothing is held any more.
    assert len(katana450.open(entry.path).t) > 50
    assert bench.ring.held is None
    assert not bench.folder.markers()
    bench.ask(do="judge", outcome="failure")
    assert bench.folder.find(1).episode.outcome is EpisodeOutcome.FAILURE


def test_discarded_episodes_come_back_and_numbers_are_not_used_twice(bench: Bench) -> None:
    for _ in range(2):
        bench.ask(do="start", task="pour")
        bench.move(40)
        bench.ask(do="stop")
    bench.ask(do="discard")
    assert bench.keeper.status()["count"] == 1
    assert [entry.episode.number for entry in bench.folder.discarded()] == [2]
    # Again: the last one, or the one that runs, is discarded, and the next has its task.
    again = bench.ask(do="rerecord")
    assert (again["number"], again["task"]) == (3, "pour")
    bench.move(40)
    assert bench.ask(do="rerecord")["number"] == 4
    bench.move(40)
    bench.ask(do="stop", outcome="success")
    assert [entry.episode.number for entry in bench.folder.kept()] == [4]
    assert [entry.episode.number for entry in bench.folder.discarded()] == [1, 2, 3]
    bench.ask(do="restore", number=2)
    assert bench.keeper.status()["count"] == 2
    with pytest.raises(InputError, match="no discarded episode 2"):
        bench.ask(do="restore", number=2)
    with pytest.raises(InputError, match="no episode 9"):
        bench.ask(do="judge", number=9, outcome="success")


def test_episode_is_trimmed_described_and_widened_again(bench: Bench) -> None:
    bench.ask(do="start", task="pour")
    bench.move(150)
    bench.ask(do="stop")
    (entry,) = bench.folder.kept()
    size = entry.size
    bench.ask(do="trim", number=1, start=0.2, end=0.9)
    trimmed = bench.folder.find(1)
    assert trimmed.episode.length == pytest.approx(0.7)
    assert trimmed.size > size
    bench.ask(do="describe", number=1, note="spilled", task="pour more")
    described = bench.folder.find(1).episode
    assert (described.note, described.task) == ("spilled", "pour more")
    bench.ask(do="trim", number=1, start=0.0, end=entry.end - entry.start)
    assert bench.folder.find(1).episode.length == pytest.approx(entry.episode.length)
    # Each description makes another file, of which the newest alone is remembered.
    assert len(bench.folder._known) == 1
    length = entry.end - entry.start
    for begin, end in ((1.0, 1.0), (0.0, 1000.0), (length + 0.02, length + 0.05)):
        with pytest.raises(InputError, match="choose a start"):
            bench.ask(do="trim", number=1, start=begin, end=end)


def test_episode_longer_than_the_ring_is_whole(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ring_module, "MAX_FILE_TICKS", 10)
    bench.ask(do="start", task="long")
    first = bench.records[0].t
    for _ in range(16):
        bench.move(10)
        bench.ring.sync()
    assert len(list(bench.ring_folder.glob("*.mcap"))) > ring_module.MAX_FILES
    bench.ask(do="stop")
    (entry,) = bench.folder.kept()
    with RecordingFile.open(entry.path) as file:
        assert verify_recording(file, described().session).ticks >= 159
        assert next(iter(file.messages(STATE))).t == pytest.approx(first, abs=0.2)
    # The next file of the ring removes what is not needed any more.
    for _ in range(3):
        bench.move(10)
        bench.ring.sync()
    assert len(list(bench.ring_folder.glob("*.mcap"))) <= ring_module.MAX_FILES


def test_episode_without_any_motion_is_not_kept(bench: Bench) -> None:
    for request in ("judge", "discard", "rerecord"):
        with pytest.raises(InputError, match="no episode yet"):
            bench.ask(do=request, **({"outcome": "success"} if request == "judge" else {}))
    bench.ask(do="start", task="pour")
    with pytest.raises(InputError, match="has not moved"):
        bench.ask(do="stop")
    assert bench.folder.count() == 0
    assert not bench.folder.markers()
    bench.ask(do="start")
    bench.move(40)
    assert bench.ask(do="stop")["task"] == "pour"


def test_episode_ends_by_itself_at_the_maximum(bench: Bench) -> None:
    bench.ask(do="start", task="long")
    bench.move(60)
    bench.t += running_episode.MAX_SECONDS - 60.0
    assert bench.keeper.status()["running"]["left"] <= 60
    bench.t += 60.0
    bench.keeper.tick()
    assert bench.keeper.status()["running"] is None
    assert "after 60 minutes" in bench.keeper.status()["notice"]
    assert bench.folder.count() == 1


def test_full_disk_is_reported_and_the_episode_saved_later(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running_episode, "RETRY_SECONDS", 0.0)
    bench.ask(do="start", task="pour")
    bench.move(60)
    # A folder stands where the file should be.
    blocked = bench.folder.path(1)
    blocked.mkdir()
    with pytest.raises(InputError, match="not saved yet"):
        bench.ask(do="judge", outcome="success")
    assert "not saved yet" in bench.keeper.status()["problem"]
    # No other episode is meant.
    with pytest.raises(InputError, match="not saved yet"):
        bench.ask(do="judge", outcome="failure")
    assert bench.ring.held is not None
    blocked.rmdir()
    bench.keeper.tick()
    assert bench.keeper.status()["problem"] == ""
    assert bench.folder.find(1).episode.outcome is EpisodeOutcome.SUCCESS


def test_episode_states_what_the_disk_did_not_take(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(running_episode, "RETRY_SECONDS", 0.0)
    bench.ask(do="start", task="pour")
    bench.move(60)
    bench.ring.sync()
    with monkeypatch.context() as full:
        full.setattr(os, "fsync", _disk_full)
        bench.move(1)
        bench.ring.sync()
        bench.move(100)
        # The episode is not saved before the disk takes something again.
        with pytest.raises(InputError, match="No space left"):
            bench.ask(do="judge", outcome="success")
    bench.ring._retry_at = 0.0
    bench.keeper.tick()
    assert bench.keeper.status()["last"]["missing_ticks"] == 101
    assert bench.folder.find(1).episode.missing_ticks == 101
    with RecordingFile.open(bench.folder.path(1)) as file:
        ticks = [tick for tick in file.messages(COMMANDS) if b'"missing"' not in tick.data]
    # What the failed sync had given to the file is not there too.
    assert ticks[-1].t == pytest.approx(motion()[59].t)
    assert main(["record", "list", str(bench.folder.folder)]) == 0
    assert "(101 ticks of 10 ms are missing)" in capsys.readouterr().out


def _disk_full(_descriptor: int) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_crash_leaves_the_running_episode_unfinished(bench: Bench) -> None:
    bench.ask(do="start", task="first")
    bench.move(60)
    bench.ask(do="stop", outcome="success")
    bench.ask(do="start", task="second")
    bench.move(100)
    bench.ring.sync()
    number = bench.keeper.status()["running"]["number"]
    # As after kill -9: nothing was ended, and the newest file of the ring has no end.
    again = bench.made()
    assert number == 2
    assert "unfinished" in again.status()["notice"]
    assert again.status()["task"] == "second"
    first, second = bench.folder.kept()
    assert first.episode.outcome is EpisodeOutcome.SUCCESS
    assert second.episode.outcome is EpisodeOutcome.UNFINISHED
    assert second.episode.length > 0.5
    assert not bench.folder.markers()
    assert recordings_in(bench.ring_folder)[-1].name in bench.made().status()["notice"]
    for path in recordings_in(bench.ring_folder):
        os.utime(path, (0.0, 0.0))
    assert bench.made().status()["notice"] == ""
    bench.keeper = again
    again.handle(episode_request('{"do": "judge", "number": 2, "outcome": "failure"}'), ADA)
    assert bench.folder.find(2).episode.outcome is EpisodeOutcome.FAILURE


def test_folder_is_listed_by_the_command_and_used_by_one_server(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(bench.folder.folder)
    bench.ask(do="start", task="pour")
    bench.move(60)
    bench.ask(do="stop", outcome="success")
    bench.ask(do="start", task="stir")
    bench.move(100)
    bench.ring.sync()
    with pytest.raises(InputError, match="Another server uses"):
        EpisodeFolder(bench.folder.folder).claim()
    assert main(["record", "list", folder]) == 0
    assert "episode 1, success: pour\nEpisode 2 runs" in capsys.readouterr().out
    # As after a crash of the server.
    bench.keeper = bench.made()
    assert main(["record", "list", folder]) == 0
    assert "episode 2, unfinished: stir" in capsys.readouterr().out


def test_folder_lists_files_only(bench: Bench, recorded: Path) -> None:
    bench.ask(do="start", task="pour")
    bench.move(50)
    bench.ask(do="stop")
    folder = bench.folder.folder
    shutil.copy(folder / "episode-0001.mcap", folder / "episode-0007.mcap")
    (folder / "episode-0008.mcap").write_bytes(b"broken")
    (folder / "notes.txt").write_text("mine")
    shutil.copy(recorded, folder / "other.mcap")
    assert [path.name for path in episode_files(folder)] == [
        "episode-0001.mcap",
        "episode-0007.mcap",
        "episode-0008.mcap",
    ]
    assert len(bench.folder.kept()) == 2
    assert "episode-0008.mcap" in bench.folder.unreadable()[0]
    assert bench.folder.next_number() == 9
    os.remove(folder / "episode-0001.mcap")
    assert [entry.path.name for entry in bench.folder.kept()] == ["episode-0007.mcap"]


def test_interrupted_episode_waits_until_its_ring_is_found(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    away = bench.ring_folder.with_name("away")
    monkeypatch.chdir(bench.ring_folder.parent)
    bench.ring_folder = Path("ring")
    bench.keeper = bench.made()
    bench.ask(do="start", task="stir")
    bench.move(100)
    bench.ring.sync()
    monkeypatch.chdir("/")
    away.with_name("ring").rename(away)
    assert "There is no folder" in bench.made().status()["notice"]
    assert len(bench.folder.markers()) == 1
    away.rename(away.with_name("ring"))
    bench.keeper = bench.made()
    assert "is kept as unfinished" in bench.keeper.status()["notice"]
    assert not bench.folder.markers()


def test_end_of_an_interrupted_episode_keeps_the_files_of_a_new_one(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.move(50)
    read, reading, may_end = bench.folder.markers, threading.Event(), threading.Event()

    def slowly() -> list[EpisodeMarker]:
        result = read()
        if threading.current_thread() is finishing:
            reading.set()
            assert may_end.wait(5.0)
        return result

    monkeypatch.setattr(bench.folder, "markers", slowly)
    # As the thread that finishes interrupted episodes.
    finishing = threading.Thread(target=bench.keeper._running.hold_needed)
    starting = threading.Thread(target=lambda: bench.ask(do="start", task="stir"))
    finishing.start()
    assert reading.wait(5.0)
    starting.start()
    starting.join(0.2)
    may_end.set()
    finishing.join()
    starting.join()
    assert bench.ring.held == bench.ring.newest
