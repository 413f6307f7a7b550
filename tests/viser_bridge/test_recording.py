"""Each text that is replaced in viser's page of a recording occurs exactly once."""

from __future__ import annotations

import re

from katana450.server.viser_bridge.recording_page import PLAYER
from katana450.server.viser_bridge.viser_page import PROGRAM, load


def test_each_change_of_the_player_is_found_once() -> None:
    text = load().files[PROGRAM].content.decode()
    # The patterns of JavaScript, with its backreferences and groups, are those of Python.
    patterns = re.findall(r"^    \[/(.*)/,(?: |$)", PLAYER, re.MULTILINE)
    assert len(patterns) == 3
    light, seek, play = (
        [match.start() for match in re.finditer(pattern, text)] for pattern in patterns
    )
    assert len(light) == len(seek) == len(play) == 1
    # Next to it the player hides all nodes, before it plays from the start.
    assert "useSceneTree.getAll()" in text[light[0] : light[0] + 200]
    # All are in the player.
    assert 0 < seek[0] - light[0] < 3000
    assert 0 < play[0] - light[0] < 4000
