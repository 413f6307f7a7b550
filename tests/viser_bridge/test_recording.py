"""Each text that is replaced in viser's page of a recording occurs exactly once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import viser
import zstandard

from katana450.server.viser_bridge.recording_page import PLAYER

PAGE = Path(viser.__file__).parent / "client" / "build" / "index.html"

DIGITS = "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_abcdefghijklmnopqrstuvwxyz{|}~"
"""Digits of the base 88 in which viser's page contains its program: 5 digits are 4 bytes."""


def program() -> str:
    """Return viser's program as its page unpacks it."""
    script = re.search(
        r'<script data-p="([^"]*)" data-ss="(\d+)"', PAGE.read_text(encoding="utf-8")
    )
    assert script
    value = np.zeros(128, dtype=np.uint64)
    value[np.frombuffer(DIGITS.encode(), dtype=np.uint8)] = np.arange(88)
    digits = value[np.frombuffer(script[1].encode(), dtype=np.uint8)]
    whole = len(digits) // 5 * 5
    powers = np.array([88**power for power in range(4, -1, -1)], dtype=np.uint64)
    packed = (digits[:whole].reshape(-1, 5) @ powers).astype(">u4").tobytes()
    rest = digits[whole:].tolist()
    if rest:
        number = 0
        for digit in rest:
            number = 88 * number + digit
        packed += number.to_bytes(len(rest) - 1, "big")
    unpacked = zstandard.ZstdDecompressor().decompressobj().decompress(packed)
    return unpacked[int(script[2]) :].decode("utf-8")


def test_each_change_of_the_player_is_found_once() -> None:
    text = program()
    # The patterns of JavaScript, with its backreferences and groups, are those of Python.
    patterns = re.findall(r"^    \[/(.*)/,(?: |$)", PLAYER, re.MULTILINE)
    assert len(patterns) == 2
    light, play = ([match.start() for match in re.finditer(pattern, text)] for pattern in patterns)
    assert len(light) == len(play) == 1
    # Next to it the player hides all nodes, before it plays from the start.
    assert "useSceneTree.getAll()" in text[light[0] : light[0] + 200]
    # Both are in the player.
    assert 0 < play[0] - light[0] < 4000
