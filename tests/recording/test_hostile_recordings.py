"""Damaged and hostile files raise InputError only, in bounded memory, and say what is wrong."""

from __future__ import annotations

import random
import resource
import struct
import tracemalloc
from pathlib import Path

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel,
    Chunk,
    DataEnd,
    Header,
    Message,
    MessageIndex,
    Metadata,
)

from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import verify_recording
from katana450.extensions.recording.files.table import columns
from katana450.extensions.recording.files.trimming import trim
from tests.conftest import LONG
from tests.exchange.mutations import mutated
from tests.recording.recorded import described, record

MUTATIONS = 2000 if LONG else 30
MAX_MEMORY = 100e6
"""Bytes; the file has less than a hundredth of it."""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "run.mcap"
    record(path, 12, 5)
    return path


def used(path: Path) -> None:
    """Use all of a file."""
    with RecordingFile.open(path) as file:
        file.counts()
        assert file.start <= file.end
        list(file.attachments())
        file.last_before("/checkpoints", file.end)
        columns(file)
        verify_recording(file, described().session)
    trim([path], path.with_suffix(".part"), 1000.03, 1000.09)


def test_mutations_raise_only_input_errors(path: Path, tmp_path: Path) -> None:
    data, chance, target = path.read_bytes(), random.Random(7), tmp_path / "m.mcap"
    refused = 0
    tracemalloc.start()
    for _ in range(MUTATIONS):
        target.write_bytes(mutated(data, chance))
        try:
            used(target)
        except InputError:
            refused += 1
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert refused > 0.5 * MUTATIONS
    assert peak < MAX_MEMORY


def packed(*records: object) -> bytes:
    builder = RecordBuilder()
    for part in records:
        part.write(builder)  # type: ignore[attr-defined]
    return bytes(builder.end())


MAGIC = b"\x89MCAP0\r\n"


def bomb(chunk: Chunk) -> bytes:
    """Return a recording with ``chunk`` and its index."""
    metadata = Metadata("katana450", {"format": "1"})
    index = MessageIndex(1, [(0, 0)])
    return MAGIC + packed(Header("katana450", "x"), metadata, chunk, index, DataEnd(0))


def chunk(data: bytes, size: int) -> Chunk:
    return Chunk("zstd", data, 2**62, 0, 0, size)


CHANNEL = packed(Channel(1, "/state", "json", {}, 1))
TEN = chunk(zstandard.compress(CHANNEL), len(CHANNEL))


@pytest.mark.parametrize("stated", [10, 2_000_000_000, 2**60])
def test_bomb_is_not_unpacked(tmp_path: Path, stated: int) -> None:
    zeros = zstandard.compress(bytes(70_000_000))
    (tmp_path / "bomb.mcap").write_bytes(bomb(chunk(zeros, stated)))
    tracemalloc.start()
    with (
        pytest.raises(InputError, match=r"size of a chunk|a chunk has \d+ bytes"),
        RecordingFile.open(tmp_path / "bomb.mcap"),
    ):
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10e6


def test_length_beyond_the_file_reserves_no_memory(path: Path, tmp_path: Path) -> None:
    data = bytearray(path.read_bytes())
    # The first one is in the metadata.
    place = data.index(b"katana450.urdf", data.index(b"katana450.urdf") + 1)
    # The length of the attached file, after its name and its media type.
    start = place + len("katana450.urdf") + 4 + len("application/xml")
    data[start : start + 8] = struct.pack("<Q", 200_000_000)
    (tmp_path / "long.mcap").write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with (
        RecordingFile.open(tmp_path / "long.mcap") as file,
        pytest.raises(InputError, match="too soon"),
    ):
        list(file.attachments())
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "is empty: nothing was recorded"),
        (b"PK\x03\x04" * 100, "is not a recording: it does not begin as MCAP files do"),
        (MAGIC + bytes(100), "is not a recording, or is damaged"),
        (bomb(TEN).replace(b"katana450", b"kathana45"), "but no recording"),
    ],
)
@pytest.mark.parametrize("act", ["info", "verify", "export"])
def test_command_says_what_is_wrong(
    content: bytes, expected: str, act: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "file.mcap"
    path.write_bytes(content)
    more = ["--out", str(tmp_path / "out.csv")] if act == "export" else []
    assert main(["record", act, str(path), *more]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"katana450: {path} ")
    assert expected in error
    assert main(["record", act, str(tmp_path / "missing.mcap"), *more]) == 1
    assert "cannot be read: No such file or directory." in capsys.readouterr().err


def test_message_with_a_wrong_value_names_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    message = Message(1, 0, b'{"t": 1, "setpoint": ["x"]}', 0, 0)
    content = CHANNEL + packed(message)
    (tmp_path / "x.mcap").write_bytes(bomb(chunk(zstandard.compress(content), len(content))))
    with (
        RecordingFile.open(tmp_path / "x.mcap") as file,
        pytest.raises(InputError, match=r"message of /state at t = 0.000 s: Expected `float`"),
    ):
        verify_recording(file, described().session)
    assert main(["record", "export", str(tmp_path / "x.mcap"), "--out", str(tmp_path / "o")]) == 1
    assert "message of /state at t = 0.000 s: Expected `float`" in capsys.readouterr().err
