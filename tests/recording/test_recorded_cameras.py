"""Pictures of cameras in episodes of a real server, and in what is exported of these."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.recording.datasets.recorded_pictures import (
    cameras_of,
    recorded_pictures,
)
from katana450.extensions.recording.files.pictures import picture_message
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.recording_writer import MessageWriter
from katana450.extensions.recording.messages import CAMERAS
from katana450.extensions.recording.playback.run import PlaybackRun
from tests.browser.server import RECORDING_APP, AppServer
from tests.cameras.mjpeg_camera import PICTURES, MjpegCamera, picture, stamp_of
from tests.media.test_files import decoded
from tests.recording.dataset_files import write_copy
from tests.recording.lerobot_check import check_dataset
from tests.recording.test_episodes_on_a_server import move, started
from tests.recording.test_recorder import POSTURES

TOPIC, WIDTH, BAR = f"{CAMERAS}table", 640, (200, 30, 30)


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of an episode with two cameras, one of which cannot be reached."""
    folder = tmp_path_factory.mktemp("cameras")
    with MjpegCamera() as camera:
        options = (
            *(f"--camera=table={camera.url}", "--camera=away=http://127.0.0.1:9/"),
            *(f"--record={folder / 'ring'}", f"--episodes={folder / 'episodes'}"),
        )
        with AppServer((*RECORDING_APP, *options)) as server:
            client = started(server, "swing")
            move(server, *POSTURES)
            client.stop("success")
    return folder / "episodes" / "episode-0001.mcap"


def test_every_picture_is_recorded_with_its_time(episode: Path) -> None:
    deserialize = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr
    numbers, delays = [], []
    with episode.open("rb") as opened:
        for schema, channel, message in make_reader(opened).iter_messages(topics=[TOPIC]):
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            image: Any = deserialize(message.data, schema.name)
            assert (image.header.frame_id, image.format) == ("table", "jpeg")
            stamp = image.header.stamp
            assert 1_000_000_000 * stamp.sec + stamp.nanosec == message.log_time
            number, sent = stamp_of(image.data.tobytes())
            numbers.append(number)
            delays.append(message.log_time / 1e9 - sent)
    with RecordingFile.open(episode) as file:
        assert len(numbers) >= 0.9 * 30 * (file.end - file.start)
    # Within the time of a picture, but for a machine that is busy for a moment.
    assert min(delays) >= 0.0
    assert np.median(delays) < 1.0 / 30
    assert len(numbers) >= 0.99 * (numbers[-1] - numbers[0] + 1)


def test_recording_with_pictures_is_verified_and_trimmed(episode: Path, tmp_path: Path) -> None:
    assert main(["record", "verify", str(episode)]) == 0
    part = tmp_path / "part.mcap"
    assert main(["record", "trim", str(episode), "--from=0.3", "--to=0.8", f"--out={part}"]) == 0
    with RecordingFile.open(episode) as whole, RecordingFile.open(part) as file:
        start, end = whole.start + 0.3, whole.start + 0.8
        expected = [message.data for message in whole.messages(TOPIC, start=start, end=end)]
        assert [message.data for message in file.messages(TOPIC)] == expected != []


def test_page_shows_the_picture_of_a_moment(episode: Path) -> None:
    run = PlaybackRun(lambda: [episode])
    run.update()
    with RecordingFile.open(episode) as file:
        first, *_, last = file.messages(TOPIC)
        offset = file.utc_offset
    shown = run.picture("table", last.t + offset + 0.1)
    assert shown is not None
    assert last.data.endswith(shown)
    # A picture is shown for half a second, and none before the first one.
    assert run.picture("table", last.t + offset + 0.6) is None
    assert run.picture("table", first.t + offset - 0.1) is None
    assert run.picture("away", last.t + offset) is None


def test_dataset_shows_the_newest_picture_in_each_frame(episode: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    words = ["record", "export", str(episode), "--format=lerobot", "--fps=10"]
    assert main([*words, f"--out={out}"]) == 0
    info = check_dataset(out)
    videos = [name for name in info["features"] if "images" in name]
    assert videos == ["observation.images.table"]
    assert info["features"][videos[0]]["shape"] == [480, 640, 3]
    shown, _ = decoded(out / f"videos/{videos[0]}/chunk-000/file-000.mp4", (640, 480))
    with RecordingFile.open(episode) as file:
        stamps = [
            (m.t, stamp_of(m.data[m.data.index(b"\xff\xd8") :])[0]) for m in file.messages(TOPIC)
        ]
        times = np.array([t for t, _ in stamps])
        frames = file.start + np.arange(len(shown)) / 10
    newest = np.maximum(np.searchsorted(times, frames, side="right") - 1, 0)
    for frame, index in zip(shown, newest.tolist(), strict=True):
        bar = np.abs(frame[240].astype(int) - BAR).sum(axis=1).argmin()
        left = WIDTH * (stamps[index][1] % PICTURES) / PICTURES
        assert -2 <= bar - left <= 22
    assert main([*words, "--cameras=", f"--out={tmp_path / 'none'}"]) == 0
    assert not (tmp_path / "none" / "videos").exists()


def test_bag_has_the_pictures(episode: Path, tmp_path: Path) -> None:
    out = tmp_path / "bag"
    assert main(["record", "export", str(episode), "--format=rosbag2", f"--out={out}"]) == 0
    with AnyReader([out]) as reader, RecordingFile.open(episode) as file:
        offset = int(file.metadata["utc_offset_ns"])
        topic = [c for c in reader.connections if c.topic == "/cameras/table/compressed"]
        pictures = {
            t - offset: image.data.tobytes()
            for c, t, data in reader.messages(topic)
            if (image := cast(Any, reader.deserialize(data, c.msgtype)))
        }
        recorded = list(file.messages(TOPIC))
        assert set(pictures) == {message.log_time for message in recorded}
        for message in recorded:
            assert message.data.endswith(pictures[message.log_time])


def with_pictures(run: Path, out: Path, times: list[float], jpeg: bytes) -> Path:
    """Write ``run`` with a picture at each of ``times`` [s] after its start."""
    with RecordingFile.open(run) as file, out.open("wb") as target:
        writer = MessageWriter(target, file.metadata, file.attachments(), ["table"])
        for message in file.messages(*file.counts()):
            writer.copy(message)
        for t in times:
            writer.copy(picture_message("table", round(1e9 * (file.start + t)), jpeg))
        writer.finish()
    return out


def test_gap_and_a_wrong_picture_are_told(run: Path, tmp_path: Path) -> None:
    gap = with_pictures(run, tmp_path / "gap.mcap", [0.0, 0.1], picture(0, (31, 17)))
    assert cameras_of([gap], None) == {"table": (30, 16)}
    assert cameras_of([gap, write_copy(run, tmp_path / "no.mcap")], None) == {}
    with pytest.raises(InputError, match="no pictures of the camera side"):
        cameras_of([gap], ["side"])
    with RecordingFile.open(gap) as file:
        times = file.start + np.array([0.0, 0.5, 1.0])
    pictures = recorded_pictures(gap, {"table": (30, 16)}, times)
    assert [next(pictures)[0].shape for _ in range(2)] == [(16, 30, 3)] * 2
    with pytest.raises(InputError, match=r"table has no picture within 0\.5 s of 1\.00 s"):
        next(pictures)
    for jpeg, why in ((b"\xff\xd8no", "cannot be read"), (b"GIF", "wrong picture")):
        wrong = with_pictures(run, tmp_path / f"{why[:3]}.mcap", [0.0], jpeg)
        with pytest.raises(InputError, match=why):
            cameras_of([wrong], None)
